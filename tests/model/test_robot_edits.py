"""An edit of a robot means what it says: gravity, armature, locks and payloads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import robot_dyn as rd
from robot_dyn.foundations import EditError, OverflowedError
from tests.queries import general

INERTIA = ((0.02, 0.001, -0.002), (0.001, 0.03, 0.003), (-0.002, 0.003, 0.04))


def assert_same(left: rd.Robot, right: rd.Robot, seed: int = 5) -> None:
    """The two say the same: M, C and N to 1e-13 of their largest entry, for sums in another order."""
    q, v, _ = general(left, seed)
    for one, other in ((left.M(q), right.M(q)), (left.C(q, v), right.C(q, v)), (left.N(q), right.N(q))):
        assert_allclose(one, other, rtol=0, atol=1e-13 * max(1.0, np.abs(other).max()))


def test_gravity_is_proportional_and_replaced():
    robot = rd.load("ur5")
    q = general(robot, 6)[0]
    upside_down = robot.with_(gravity=(1, 2, 3)).with_(gravity=-np.array(rd.STANDARD_GRAVITY))
    assert_array_equal(upside_down.N(q), -robot.N(q))
    assert_array_equal(robot.with_(gravity=[0, 0, 0]).N(q), np.zeros(6))
    assert_array_equal(upside_down.M(q), robot.M(q))


@pytest.mark.parametrize("name", ["ur5", "panda", "skew_tree"])
def test_armature_adds_its_diagonal_to_M_alone(name: str):
    """M + diag(armature); one rounding of the sum."""
    robot = rd.load(name)
    values = np.linspace(0.1, 0.7, robot.n)
    q, v, _ = general(robot, 7)
    for armature in (values, dict(zip(robot.joint_names, values, strict=True))):
        driven = robot.with_(armature=9.0).with_(armature=armature)
        assert_array_equal(driven.armature, values)
        assert_allclose(driven.M(q), robot.M(q) + np.diag(values), rtol=1e-14, atol=1e-16)
        assert_allclose(driven.C(q, v), robot.C(q, v), rtol=0, atol=1e-15)
        assert_allclose(driven.N(q), robot.N(q), rtol=0, atol=1e-15)
    assert_array_equal(robot.with_(armature=0.25).armature, np.full(robot.n, 0.25))


def test_armature_stores_kinetic_energy():
    """K = ½ vᵀ M v with the drives in M; pin.computeKineticEnergy leaves them out where an axis is not x, y or z."""
    robot = rd.load("skew_tree")
    q, v, _ = general(robot, 12)
    values = np.linspace(0.1, 0.7, robot.n)
    driven = robot.with_(armature=values)
    assert_allclose(driven.kinetic_energy(q, v), v @ driven.M(q) @ v / 2, rtol=1e-15)
    assert_allclose(driven.kinetic_energy(q, v), robot.kinetic_energy(q, v) + values @ v**2 / 2, rtol=1e-14)


@pytest.mark.parametrize(("name", "held"), [("ur5", (1, 4)), ("panda", (2, 7)), ("skew_tree", (2,))])
def test_locking_leaves_the_sub_block(name: str, held: tuple[int, ...]):
    """A held joint is q = value, v = 0: the rest of M, C, N; 1e-13 because bodies are merged."""
    robot = rd.load(name)
    q, v, _ = general(robot, 8)
    v[list(held)] = 0
    rest = np.delete(np.arange(robot.n), held)
    locked = robot
    for i in held:  # locks add up
        locked = locked.with_(lock={robot.joint_names[i]: q[i]})
    assert locked == robot.with_(lock={robot.joint_names[i]: q[i] for i in held})
    assert locked.joint_names == tuple(robot.joint_names[i] for i in rest)
    block = np.ix_(rest, rest)
    assert_allclose(locked.M(q[rest]), robot.M(q)[block], rtol=0, atol=1e-13)
    assert_allclose(locked.C(q[rest], v[rest]), robot.C(q, v)[block], rtol=0, atol=1e-13)
    assert_allclose(locked.N(q[rest]), robot.N(q)[rest], rtol=0, atol=1e-12)
    frame = robot.frame_names[-1]
    assert_allclose(locked.placement(q[rest], frame), robot.placement(q, frame), rtol=0, atol=1e-14)
    assert_array_equal(locked.lower, robot.lower[rest])


def test_payload_is_a_link_fastened_by_a_fixed_joint(tmp_path: Path):
    robot = rd.load("skew_tree")
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    moments = " ".join(f'{k}="{INERTIA[i][j]}"' for k, (i, j) in zip(keys, zip(*np.triu_indices(3)), strict=True))  # noqa: B905
    body = f'<inertial><origin xyz="0.1 -0.2 0.3"/><mass value="1.7"/><inertia {moments}/></inertial>'
    link = f'<link name="load">{body}</link><joint name="grip" type="fixed"><parent link="left_tool"/>'
    text = Path(robot.description.source).read_text().replace("</robot>", f'{link}<child link="load"/></joint></robot>')
    (tmp_path / "loaded.urdf").write_text(text)
    payload = rd.Payload("left_tool", 1.7, (0.1, -0.2, 0.3), INERTIA)
    assert_same(robot.with_(payload=payload), rd.load(tmp_path / "loaded.urdf"))
    assert_same(robot.with_(payload=payload).with_(payload=payload), robot.with_(payload=(payload, payload)))
    assert_same(robot.with_(payload=rd.Payload("base", 5.0)), robot)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        ({"lock": {"elbow": 0.1}}, "lock: no free joint 'elbow'; nearest: elbow_joint"),
        ({"lock": {"elbow_joint": "open"}}, "lock of 'elbow_joint'"),
        ({"lock": {"elbow_joint": np.nan}}, "lock of 'elbow_joint' must be finite"),
        ({"lock": {"elbow_joint": [1, 2]}}, "lock of 'elbow_joint'"),
        ({"lock": {7: 0.1}}, "lock: no free joint 7"),
        ({"lock": 0.5}, "lock"),
        ({"lock": ["elbow_joint"]}, "lock"),
        ({"armature": -0.1}, "armature of 'shoulder_pan_joint' must not be negative"),
        ({"armature": [0.1, 0.2]}, r"armature must be one number or of shape \(6,\)"),
        ({"armature": "big"}, "armature"),
        ({"armature": {"wrist_4_joint": 0.1}}, "armature: no free joint 'wrist_4_joint'.*nearest: wrist_"),
        ({"gravity": (0, -9.8)}, r"gravity must have shape \(3,\)"),
        ({"gravity": (0, 0, np.inf)}, "gravity must be finite"),
        ({"gravity": "down"}, "gravity must be real numbers"),
        ({"gravity": np.array([0, 0, 1j])}, "gravity must be real numbers"),
        ({"payload": rd.Payload("tol0", 1.0)}, "payload: no frame 'tol0'; nearest: tool0"),
        ({"payload": ["tool0"]}, "payload must be a Payload"),
        ({"payload": 3.0}, "payload must be a Payload"),
    ],
)
def test_edit_without_meaning_is_refused(edit: dict[str, Any], said: str):
    with pytest.raises(EditError, match=said):
        rd.load("ur5").with_(**edit)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"mass": 1.0, "frame": None}, "payload frame: got None; give the name of a link"),
        ({"mass": -1.0}, "payload mass must not be negative"),
        ({"mass": "heavy"}, "payload mass"),
        ({"mass": 1.0, "com": (0, 0)}, "payload com"),
        ({"mass": 1.0, "com": (0, 0, np.nan)}, "payload com must be finite"),
        ({"mass": 1.0, "inertia": 0.1}, "payload inertia"),
        ({"mass": 1.0, "inertia": ((1, 2, 0), (0, 1, 0), (0, 0, 1))}, "payload inertia must be symmetric"),
    ],
)
def test_payload_without_meaning_is_refused(values: dict[str, Any], said: str):
    with pytest.raises(EditError, match=said):
        rd.Payload(**{"frame": "tool0"} | values)


def test_some_joint_must_stay_free():
    for name in ("ur5", "panda"):
        robot = rd.load(name)
        with pytest.raises(EditError, match="all joints are locked"):
            robot.with_(lock=dict.fromkeys(robot.joint_names, 0.1))


FINGERS = np.vstack([np.eye(8), np.eye(8)[-1]]), np.zeros(9)
CHAIN = np.array([[1, 0], [0.5, 0], [-0.375, 0], [0, 1]]), np.array([0, 0.1, 0.125, 0])  # by hand, see its file


@pytest.mark.parametrize(("name", "S", "s0"), [("panda", *FINGERS), ("mimic_chain", *CHAIN)])
def test_coupled_joints_are_those_of_the_full_model_by_virtual_work(name: str, S: np.ndarray, s0: np.ndarray):
    """The full model read by Pinocchio alone; 1e-14, and 1e-13 for torques of some 10 N m, for the order of sums."""
    robot = rd.load(name)
    full = pin.buildModelFromUrdf(robot.description.source)
    full.gravity.linear = np.array(rd.STANDARD_GRAVITY)
    data = full.createData()
    assert (full.nv, robot.n) == S.shape and list(robot.model.names) == list(full.names)
    assert_allclose(robot.couplings.S, S, rtol=0, atol=1e-16)
    assert_allclose(robot.couplings.s0, s0, rtol=0, atol=1e-16)
    q, v, a = general(robot, 3)
    Q, V, A = S @ q + s0, S @ v, S @ a
    assert_allclose(robot.M(q), S.T @ pin.crba(full, data, Q) @ S, rtol=0, atol=1e-14)
    assert_allclose(robot.C(q, v), S.T @ pin.computeCoriolisMatrix(full, data, Q, V) @ S, rtol=0, atol=1e-14)
    assert_allclose(robot.N(q), S.T @ pin.computeGeneralizedGravity(full, data, Q), rtol=0, atol=1e-13)
    assert_allclose(robot.inverse_dynamics(q, v, a), S.T @ pin.rnea(full, data, Q, V, A), rtol=0, atol=1e-13)
    frame = robot.frame_names[-1]
    index = full.getFrameId(frame, pin.FrameType.BODY)
    J = pin.computeFrameJacobian(full, data, Q, index, pin.LOCAL_WORLD_ALIGNED)
    assert_allclose(robot.jacobian(q, frame), J @ S, rtol=0, atol=1e-14)
    assert_allclose(robot.placement(q, frame), data.oMf[index].homogeneous, rtol=0, atol=1e-14)


def test_chain_of_couplings_composes():
    """flex_1 = 0.5 spread + 0.1 and flex_2 = −0.75 (0.5 spread + 0.1) + 0.2; friction by virtual work."""
    robot = rd.load("mimic_chain")
    assert robot.joint_names == ("spread", "twist")
    assert_allclose(robot.damping, [0.01 * (1 + 0.5**2 + 0.375**2), 0], rtol=1e-15)
    assert_allclose(robot.friction, [0.02 * (1 + 0.5 + 0.375), 0], rtol=1e-15)


def test_a_held_joint_holds_those_that_follow_it():
    robot = rd.load("mimic_chain")
    held = robot.with_(lock={"spread": 0.4})
    assert held.joint_names == tuple(held.model.names[1:]) == ("twist",)
    tip = robot.frame_names[-1]
    assert_allclose(held.placement([0.7], tip), robot.placement([0.4, 0.7], tip), rtol=0, atol=1e-15)


def test_a_joint_that_is_held_or_follows_cannot_be_locked():
    robot = rd.load("panda").with_(lock={"panda_joint1": 0.1})
    for name in ("panda_joint1", "panda_finger_joint2"):
        with pytest.raises(EditError, match=f"no free joint '{name}'"):
            robot.with_(lock={name: 0.2})


def test_couplings_are_read_only():
    """Every query goes through S and s₀."""
    couplings = rd.load("panda").couplings
    for array in (couplings.S, couplings.s0):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@pytest.mark.parametrize("implementation", ["Pinocchio", "Lagrangian", "machine code"])
def test_where_rounding_hides_the_joints_that_follow_the_state_is_refused(implementation: str) -> None:
    """Half of 3e6 rad is known to 1e-9 rad, half of 1e15 rad to 0.1 rad, with as few digits of M; balls know both."""
    robot = rd.load("mimic_chain")
    engine = {"Pinocchio": robot, "Lagrangian": rd.Lagrangian(robot), "machine code": rd.compiled(robot)}[
        implementation
    ]
    q = np.full((19, 2), 0.3)
    q[5], q[7] = 3e6, 1e15
    truth = rd.Lagrangian(robot, rd.accuracy.Ball(200))
    with pytest.raises(OverflowedError, match=r"positions of mimic joints are not exact .* in row 7 of the batch"):
        engine.M(q)
    with pytest.raises(OverflowedError, match="positions of mimic joints are not exact"):
        engine.M(q[7])
    M = engine.nan_rows.M(q)
    assert np.isnan(M[7]).all() and np.isfinite(np.delete(M, 7, axis=0)).all()
    assert_allclose(M[5], rd.accuracy.midpoint(truth.M(q[5])), rtol=1e-7)
    assert np.isfinite(rd.accuracy.midpoint(truth.M(q[7]))).all()


@pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
@pytest.mark.parametrize("name", ["solo", "panda"])
def test_far_out_a_joint_that_nothing_rounds_is_where_it_is(name: str) -> None:
    """Solo: the implementations number joints in two orders and none follows; the fingers of the Panda follow."""
    robot = rd.load(name)
    q = 1e16 * np.random.default_rng(7).uniform(0.3, 1, robot.n)
    allowed = 64 * robot.n * 2.0**-53  # two implementations, 32 n u each
    expected = robot.M(q)
    size = np.sqrt(np.outer(expected.diagonal(), expected.diagonal()))
    for engine in (rd.Lagrangian(robot), rd.compiled(robot)):
        assert (np.abs(engine.M(q) - expected) / size).max() <= allowed
