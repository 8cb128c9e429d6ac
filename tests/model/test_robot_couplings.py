"""Tied joints: q_full = S q + s₀, so that M = Sᵀ M_full S, C = Sᵀ C_full S, N = Sᵀ N_full."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import robot_dyn as rd
from robot_dyn.foundations import EditError, OverflowedError
from tests.queries import general

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
    engine = {"Pinocchio": robot, "Lagrangian": rd.Lagrangian(robot), "machine code": rd.Compiled(robot)}[
        implementation
    ]
    q = np.full((19, 2), 0.3)
    q[5], q[7] = 3e6, 1e15
    truth = rd.Lagrangian(robot, rd.accuracy.Ball(200))
    with pytest.raises(OverflowedError, match=r"positions of mimic joints are not exact .* in row 7 of the batch"):
        engine.M(q)
    with pytest.raises(OverflowedError, match="positions of mimic joints are not exact"):
        engine.M(q[7])
    M = engine.M(q, errors="nan")
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
    for engine in (rd.Lagrangian(robot), rd.Compiled(robot)):
        assert (np.abs(engine.M(q) - expected) / size).max() <= allowed
