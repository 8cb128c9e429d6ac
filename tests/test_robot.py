"""The contract of `Robot`: it says what Pinocchio says, and an edit of it means what it says."""

from __future__ import annotations

import pickle
from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import robot_dyn as rd
from robot_dyn.errors import EditError, ModelWarning, OverflowedError, SingularError

ROBOTS = ("pendulum", "cart_pole", "ur5", "kinova", "panda", "mimic_chain", "skew_tree")
INERTIA = ((0.02, 0.001, -0.002), (0.001, 0.03, 0.003), (-0.002, 0.003, 0.04))


def general(robot: rd.Robot, seed: int, count: int = 3) -> np.ndarray:
    """General q, v, a or tau: no zeros, no symmetries."""
    return np.random.default_rng(seed).uniform(0.1, 1.2, (count, robot.n)) * [[1], [-1], [1]][:count]


def assert_same(left: rd.Robot, right: rd.Robot, seed: int = 5) -> None:
    """The two say the same: M, C and N to 1e-13 of their largest entry, for sums in another order."""
    q, v, _ = general(left, seed)
    for one, other in ((left.M(q), right.M(q)), (left.C(q, v), right.C(q, v)), (left.N(q), right.N(q))):
        assert_allclose(one, other, rtol=0, atol=1e-13 * max(1.0, np.abs(other).max()))


def urdf(tmp_path: Path, links: dict[str, str], joints: dict[str, tuple[str, str, str]]) -> Path:
    """A file of links (name → content) and joints (name → parent, child, content)."""
    parts = [f'<link name="{name}">{content}</link>' for name, content in links.items()]
    parts += [
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>{content}</joint>'
        for name, (parent, child, content) in joints.items()
    ]
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="arm">{"".join(parts)}</robot>')
    return path


def point_mass(xyz: str) -> str:
    moments = " ".join(f'{key}="0"' for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    return f'<inertial><origin xyz="{xyz}"/><mass value="1"/><inertia {moments}/></inertial>'


# --- what Pinocchio says


def test_untied_robot_says_what_pinocchio_says_bit_for_bit():
    robot = rd.load("ur5")
    model = robot.model
    data = model.createData()
    for seed in range(20):
        q, v, x = general(robot, seed)
        M, C = pin.crba(model, data, q), pin.computeCoriolisMatrix(model, data, q, v)
        assert_array_equal(robot.M(q), M)
        assert_array_equal(robot.C(q, v), C)
        assert_array_equal(robot.N(q), pin.computeGeneralizedGravity(model, data, q))
        assert_array_equal(robot.inverse_dynamics(q, v, x), pin.rnea(model, data, q, v, x))
        assert_array_equal(robot.forward_dynamics(q, v, x), pin.aba(model, data, q, v, x))
        assert robot.kinetic_energy(q, v) == pin.computeKineticEnergy(model, data, q, v)
        assert robot.potential_energy(q) == pin.computePotentialEnergy(model, data, q)
        assert_array_equal(robot.momentum(q, v), np.matvec(M, v))
        assert_array_equal(robot.coriolis_torque(q, v), np.matvec(C, v))
        assert_array_equal(robot.coriolis_transpose(q, v), np.vecmat(v, C))


def test_frames_are_those_of_pinocchio_bit_for_bit():
    robot = rd.load("ur5")
    model, data = robot.model, robot.model.createData()
    q, v, _ = general(robot, 1)
    references = {"world_aligned": pin.LOCAL_WORLD_ALIGNED, "body": pin.LOCAL, "world": pin.WORLD}
    for name in robot.frame_names:
        frame = model.getFrameId(name, pin.FrameType.BODY)
        pin.framesForwardKinematics(model, data, q)
        assert_array_equal(robot.placement(q, name), data.oMf[frame].homogeneous)
        for axes, reference in references.items():
            J = pin.computeFrameJacobian(model, data, q, frame, reference)
            assert_array_equal(robot.jacobian(q, name, expressed_in=axes), J)
            pin.computeJointJacobiansTimeVariation(model, data, q, v)
            dJ = pin.getFrameJacobianTimeVariation(model, data, frame, reference)
            assert_array_equal(robot.jacobian_rate(q, v, name, expressed_in=axes), dJ)


@pytest.mark.parametrize("name", ROBOTS)
def test_equation_of_motion(name: str):
    """M a + C v + N = τ and FD(ID(a)) = a: 1e-12, and 1e-9 for the solve, since κ(M) is up to 1e4."""
    robot = rd.load(name)
    q, v, a = general(robot, 2)
    tau = robot.inverse_dynamics(q, v, a)
    assert_allclose(robot.M(q) @ a + robot.C(q, v) @ v + robot.N(q), tau, rtol=1e-12, atol=1e-12)
    assert_allclose(robot.forward_dynamics(q, v, tau), a, rtol=1e-9)
    assert_allclose(robot.kinetic_energy(q, v), v @ robot.M(q) @ v / 2, rtol=1e-12)
    assert_array_equal(robot.M(q), robot.M(q).T)


def test_pendulum_of_one_rod():
    """I = m l²/3 about the pivot, V = −m g (l/2) cos q, τ = m g (l/2) sin q [any textbook]."""
    robot, g = rd.load("pendulum"), 9.80665
    q = np.array([0.7])
    assert_allclose(robot.M(q), [[1 / 3]], rtol=1e-15)
    assert_allclose(robot.N(q), [g / 2 * np.sin(0.7)], rtol=1e-15)
    assert_allclose(robot.potential_energy(q), -g / 2 * np.cos(0.7), rtol=1e-15)


# --- tied joints


def test_tied_fingers_of_panda():
    """M = Sᵀ M_full S, N = Sᵀ N_full with the full model read by Pinocchio alone; 1e-14 for the order of sums."""
    robot = rd.load("panda")
    full = pin.buildModelFromUrdf(robot.description.source)
    full.gravity.linear = np.array(rd.STANDARD_GRAVITY)
    data = full.createData()
    S = np.vstack([np.eye(8), np.eye(8)[-1]])
    assert (robot.n, full.nv) == (8, 9)
    assert_array_equal(robot.ties.S, S)
    q, v, _ = general(robot, 3)
    assert_allclose(robot.M(q), S.T @ pin.crba(full, data, S @ q) @ S, rtol=0, atol=1e-14)
    assert_allclose(robot.N(q), S.T @ pin.computeGeneralizedGravity(full, data, S @ q), rtol=0, atol=1e-13)
    C = pin.computeCoriolisMatrix(full, data, S @ q, S @ v)
    assert_allclose(robot.C(q, v), S.T @ C @ S, rtol=0, atol=1e-14)


def test_chain_of_ties_composes():
    """flex_1 = 0.5 spread + 0.1 and flex_2 = −0.75 (0.5 spread + 0.1) + 0.2, worked out by hand."""
    robot = rd.load("mimic_chain")
    assert robot.joint_names == ("spread", "twist")
    rows = dict(zip(robot.model.names[1:], zip(robot.ties.S.tolist(), robot.ties.s0, strict=True), strict=True))
    expected = {"spread": (1, 0, 0), "flex_1": (0.5, 0, 0.1), "flex_2": (-0.375, 0, 0.125), "twist": (0, 1, 0)}
    for name, (first, second, offset) in expected.items():
        assert_allclose([*rows[name][0], rows[name][1]], [first, second, offset], rtol=0, atol=1e-16, err_msg=name)
    assert_allclose(robot.damping, [0.01 * (1 + 0.5**2 + 0.375**2), 0], rtol=1e-15)
    assert_allclose(robot.friction, [0.02 * (1 + 0.5 + 0.375), 0], rtol=1e-15)


# --- what it is


def test_immutable_with_read_only_arrays():
    robot = rd.load("ur5")
    for name in ("description", "edits", "name", "n", "lower", "anything"):
        with pytest.raises((FrozenInstanceError, AttributeError)):
            setattr(robot, name, None)
    for name in ("lower", "upper", "effort_limit", "velocity_limit", "armature", "damping", "friction"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(robot, name)[0] = 1.0


def test_ties_are_read_only():
    """Every query goes through S and s₀."""
    ties = rd.load("panda").ties
    for array in (ties.S, ties.s0):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@pytest.mark.parametrize("name", ["ur5", "panda", "skew_tree"])
def test_pickled_robot_is_the_same_robot(name: str):
    robot = rd.load(name)
    robot = robot.with_(
        lock={robot.joint_names[1]: 0.3}, armature=0.1, payload=rd.Payload(robot.frame_names[-1], 0.5, (0.1, 0.2, 0.3))
    )
    robot.M(general(robot, 0)[0])  # so that there is something cached
    copy = pickle.loads(pickle.dumps(robot))
    q, v, a = general(robot, 4)
    assert copy == robot and hash(copy) == hash(robot)
    assert_array_equal(copy.inverse_dynamics(q, v, a), robot.inverse_dynamics(q, v, a))
    assert robot != robot.with_(armature=0.2) and robot != rd.load(name)


def test_continuous_joints_are_one_number_without_limits():
    kinova = rd.load("kinova")
    turning = [i for i, name in enumerate(kinova.joint_names) if name[-1] in "146"]
    assert kinova.model.nq == kinova.model.nv == kinova.n == 6
    assert_array_equal(kinova.lower[turning], -np.inf)
    assert_array_equal(kinova.upper[turning], np.inf)
    assert np.isfinite(np.delete(kinova.lower, turning)).all()


def test_revolute_joints_without_stated_bounds_are_unlimited():
    robot = rd.load("centauro")
    wheels = [i for i, name in enumerate(robot.joint_names) if name.startswith("j_wheel")]
    assert len(wheels) == 4
    assert_array_equal(robot.lower[wheels], -np.inf)
    assert_array_equal(robot.upper[wheels], np.inf)


def test_stated_limits_are_those_of_the_file():
    robot = rd.load("skew_tree")
    assert_array_equal(robot.lower, [-np.inf, -2.5, -0.3, -2.5, -2.2])
    assert_array_equal(robot.effort_limit, [np.inf, 60, 200, 60, 40])
    assert_array_equal(robot.velocity_limit, [np.inf, 4, 1, 4, 5])


def test_total_mass_counts_the_base_and_every_payload():
    """Sums of decimal masses in another order: 1e-14."""
    assert_allclose(rd.load("mimic_chain").total_mass, 1.0, rtol=1e-14)
    assert_allclose(rd.load("skew_tree").total_mass, 4 + 3 + 1.5 + 0.8 + 0.3 + 1.4 + 0.7, rtol=1e-14)
    panda = rd.load("panda")
    assert_allclose(panda.with_(lock={"panda_finger_joint1": 0.02}).total_mass, panda.total_mass, rtol=1e-14)
    loaded = panda.with_(payload=[rd.Payload("panda_hand", 0.7), rd.Payload("panda_link0", 0.3)])
    assert_allclose(loaded.total_mass, panda.total_mass + 1, rtol=1e-14)


# --- edits


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
        ({"lock": {"elbow": 0.1}}, "lock: no joint 'elbow' that moves freely; nearest: elbow_joint"),
        ({"lock": {"elbow_joint": "open"}}, "lock of 'elbow_joint'"),
        ({"lock": {"elbow_joint": np.nan}}, "lock of 'elbow_joint' must be finite"),
        ({"lock": {"elbow_joint": [1, 2]}}, "lock of 'elbow_joint'"),
        ({"lock": {7: 0.1}}, "lock: no joint 7"),
        ({"lock": 0.5}, "lock"),
        ({"lock": ["elbow_joint"]}, "lock"),
        ({"armature": -0.1}, "armature of 'shoulder_pan_joint' must not be negative"),
        ({"armature": [0.1, 0.2]}, r"armature must be finite numbers of shape \(6,\)"),
        ({"armature": "big"}, "armature"),
        ({"armature": {"wrist_4_joint": 0.1}}, "armature: no joint 'wrist_4_joint' .*nearest: wrist_"),
        ({"gravity": (0, -9.8)}, r"gravity must be finite numbers of shape \(3,\)"),
        ({"gravity": (0, 0, np.inf)}, "gravity must be finite"),
        ({"gravity": "down"}, "gravity must be numbers"),
        ({"gravity": np.array([0, 0, 1j])}, "gravity must be numbers"),
        ({"payload": rd.Payload("tol0", 1.0)}, "payload: no frame 'tol0'; nearest: tool0"),
        ({"payload": rd.Payload(None, 1.0)}, "payload"),  # type: ignore[arg-type]
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
        rd.Payload("tool0", **values)


def test_some_joint_must_stay_free():
    for name in ("ur5", "panda"):
        robot = rd.load(name)
        with pytest.raises(EditError, match="no joint is left to move"):
            robot.with_(lock=dict.fromkeys(robot.joint_names, 0.1))


def test_a_joint_that_is_held_or_follows_cannot_be_locked():
    robot = rd.load("panda").with_(lock={"panda_joint1": 0.1})
    for name in ("panda_joint1", "panda_finger_joint2"):
        with pytest.raises(EditError, match=f"no joint '{name}' that moves freely"):
            robot.with_(lock={name: 0.2})


# --- what has no answer


def test_massless_tip_has_no_forward_dynamics_until_it_is_held_or_loaded():
    with pytest.warns(ModelWarning, match="link 'pointer'"):
        robot = rd.load("massless_tip")
    q, v, tau = general(robot, 9)
    assert np.isfinite(robot.inverse_dynamics(q, v, tau)).all()
    for x in (q, q.tolist(), [q, q]):
        with pytest.raises(SingularError, match="'pointer_joint'"):
            robot.forward_dynamics(x, v, tau)
    assert np.isfinite(robot.with_(lock={"pointer_joint": 0.2}).forward_dynamics(q[:1], v[:1], tau[:1])).all()
    loaded = robot.with_(payload=rd.Payload("pointer", 0.1, inertia=INERTIA))
    assert_allclose(loaded.inverse_dynamics(q, v, loaded.forward_dynamics(q, v, tau)), tau, rtol=1e-12)


@pytest.mark.filterwarnings("ignore::robot_dyn.errors.ModelWarning")
def test_M_that_is_singular_where_the_mass_lies_on_the_outer_axis(tmp_path: Path):
    """M = diag(m l² sin² q₂, m l²) for a point mass on the z axis at q₂ = 0."""
    links = {"base": "", "yoke": "", "bob": point_mass("0 0 0.5")}
    joints = {"pan": ("base", "yoke", '<axis xyz="0 0 1"/>'), "tilt": ("yoke", "bob", '<axis xyz="0 1 0"/>')}
    robot = rd.load(urdf(tmp_path, links, joints))
    v, tau = np.array([0.3, -0.4]), np.array([0.6, 0.7])
    assert_allclose(robot.M(np.array([0.7, 0.9])), np.diag([0.25 * np.sin(0.9) ** 2, 0.25]), rtol=0, atol=1e-16)
    for tilt in (0.9, 0.1, -0.1, 2.0):
        q = np.array([0.7, tilt])
        assert_allclose(robot.inverse_dynamics(q, v, robot.forward_dynamics(q, v, tau)), tau, rtol=1e-10)
    for q in (np.array([0.7, 0.0]), [0.7, 0.0], [[0.7, 0.9], [0.7, 0.0]]):
        with pytest.raises(SingularError, match="'pan' carries no inertia at this q"):
            robot.forward_dynamics(q, v, tau)


@pytest.mark.filterwarnings("ignore::robot_dyn.errors.ModelWarning")
@pytest.mark.parametrize(("l1", "l2"), [(0.3, 0.7), (0.67, 0.34), (0.83, 0.92)])
def test_M_that_is_singular_where_the_arm_is_straight(tmp_path: Path, l1: float, l2: float):
    """M has det M = m² l₁² l₂² sin² q₂ for a point mass at the tip alone; rounding decides how ABA fails at q₂ = 0."""
    links = {"base": "", "upper": "", "lower": point_mass(f"{l2} 0 0")}
    z = '<axis xyz="0 0 1"/>'
    joints = {"shoulder": ("base", "upper", z), "elbow": ("upper", "lower", f'<origin xyz="{l1} 0 0"/>{z}')}
    robot = rd.load(urdf(tmp_path, links, joints))
    v, tau = np.array([0.3, -0.4]), np.array([0.6, 0.7])
    q = np.array([0.2, 0.9])
    assert_allclose(robot.inverse_dynamics(q, v, robot.forward_dynamics(q, v, tau)), tau, rtol=1e-10)
    with pytest.raises(SingularError, match=r"no forward dynamics: joint '(shoulder|elbow)'"):
        robot.forward_dynamics(np.array([0.2, 0.0]), v, tau)


@pytest.mark.parametrize("name", ["ur5", "panda", "skew_tree"])
@pytest.mark.parametrize("form", [np.asarray, np.ndarray.tolist])
def test_arguments_too_large_for_float64_raise(name: str, form: Any):
    """A force quadratic in v, 1e200² > 1.8e308; the argument that the user gave is named."""
    robot = rd.load(name)
    q, v, a = general(robot, 10)
    fast = 1e200 * v
    for method in ("coriolis_torque", "coriolis_transpose", "kinetic_energy"):
        with pytest.raises(OverflowedError, match="q, v are so large"):
            getattr(robot, method)(form(q), form(fast))
    with pytest.raises(OverflowedError, match="q, v, a are so large"):
        robot.inverse_dynamics(form(q), form(fast), form(a))
    with pytest.raises(OverflowedError, match="q, v, tau are so large"):
        robot.forward_dynamics(form(q), form(fast), form(a))
    with pytest.raises(OverflowedError, match="q, v are so large"):
        robot.momentum(form(q), form(np.full(robot.n, 1e308)))


def test_overflow_is_seen_where_position_and_velocity_are_orthogonal():
    """C of a slide at 1e200 m on a shaft at 1e200 rad/s overflows although q · v = 0."""
    robot = rd.load("skew_tree")
    with pytest.raises(OverflowedError):
        robot.C(np.array([0, 0, 1e200, 0, 0]), np.array([1e200, 0, 0, 0, 0]))
    with pytest.raises(OverflowedError):
        robot.M(np.array([0, 0, 1e200, 0, 0]))


def test_huge_arguments_with_a_finite_answer_are_answered_without_a_warning():
    """sin(1e200) is a number; pytest turns NumPy's warnings into errors."""
    robot = rd.load("ur5")
    q, v, a = general(robot, 11)
    far = 1e200 * q
    assert_array_equal(robot.M(far), robot.M(far.tolist()))
    assert_array_equal(robot.N(far), robot.N(far.tolist()))
    assert_array_equal(robot.C(far, v), robot.C(far.tolist(), v))
    assert np.isfinite(robot.inverse_dynamics(q, v, 1e200 * a)).all()
    assert np.isfinite(robot.forward_dynamics(q, v, 1e200 * a)).all()
