"""Inverse kinematics: answers reach the pose within the limits; what is out of reach is said, with its cause."""

from __future__ import annotations

import warnings

import numpy as np
import pinocchio as pin
import pytest

import robot_dyn as rd
from robot_dyn.control import InverseKinematics, orientation_error
from robot_dyn.control.pose import error_and_jacobian, logarithm
from robot_dyn.foundations import PlanError, QueryError, hat
from tests.long import long, stress

# kinova has continuous joints, panda a coupled one
ARMS = {"ur5": "tool0", "panda": "panda_hand", "kinova": "j2s6s200_end_effector", "xarm7": "link_eef", "z1": "link06"}


SOME = ["ur5", "panda", *long(["kinova", "xarm7", "z1"])]


def load(name: str) -> rd.Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rd.ModelWarning)
        return rd.load(name)


def errors(arm: rd.Robot, frame: str, q: np.ndarray, g: np.ndarray) -> tuple[float, float]:
    """Distance and angle from a pose, by forward kinematics."""
    here = arm.placement(q, frame)
    turn = orientation_error(g[:3, :3], here[:3, :3])
    return float(np.linalg.norm(here[:3, 3] - g[:3, 3])), float(np.linalg.norm(turn))


def reached(name: str, poses: int) -> float:
    """The part of poses at random positions that were reached, each judged by forward kinematics."""
    arm, frame, rng = load(name), ARMS[name], np.random.default_rng(1)
    found = 0
    for seed in range(poses):
        g = arm.placement(arm.random_configuration(rng), frame)
        answer = rd.control.inverse_kinematics(arm, g, frame=frame, seed=seed)
        assert answer.starts == 20
        for q in answer.solutions:
            assert (arm.lower <= q).all() and (q <= arm.upper).all()
            assert max(errors(arm, frame, q, g)) <= 1e-9
        found += answer.converged
    return found / poses


@pytest.mark.parametrize("name", SOME)
def test_poses_of_positions_within_the_limits_are_reached(name: str) -> None:
    assert reached(name, 20) == 1


@pytest.mark.parametrize("poses", [*long([100]), *stress([1000])])
@pytest.mark.parametrize("name", SOME)
def test_99_of_100_poses_are_reached(name: str, poses: int) -> None:
    assert reached(name, poses) >= 0.99


@pytest.mark.parametrize("name", SOME)
def test_the_residual_falls_along_the_jacobian(name: str) -> None:
    """e(q + J⁺e h) = (1 − h) e + O(h ‖e‖²): at ‖e‖ of 1e-4 and h of 1, 1e-7 is left at most."""
    arm, rng = load(name), np.random.default_rng(2)
    q = arm.random_configuration(rng)
    g = arm.placement(q + 1e-4 * rng.uniform(-1, 1, arm.n), ARMS[name])[None]
    e, J = error_and_jacobian(arm, ARMS[name], g, q[None])
    left, _ = error_and_jacobian(arm, ARMS[name], g, q[None] + (np.linalg.pinv(J, rcond=1e-6) @ e[..., None])[..., 0])
    assert np.linalg.norm(left) < 1e-3 * np.linalg.norm(e)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 0.019, 0.021, 1.0, 3.0, np.pi - 1e-6])
def test_the_logarithm_inverts_the_exponential(angle: float) -> None:
    """Against SciPy's exponential of the matrix; 1e-14 is some tens of units of rounding."""
    from scipy.linalg import expm

    rng = np.random.default_rng(3)
    axis, v = rng.normal(size=3), rng.normal(size=3)
    phi = angle * axis / np.linalg.norm(axis)
    twist = np.zeros((4, 4))
    twist[:3, :3], twist[:3, 3] = hat(phi), v
    g = expm(twist)
    np.testing.assert_allclose(logarithm(g[:3, :3], g[:3, 3]), [*v, *phi], atol=1e-9 if angle > 3.1 else 1e-14)


def answer_at_limit() -> tuple[rd.Robot, InverseKinematics]:
    arm = load("panda").with_(lock={"panda_finger_joint1": 0.01})
    q = (arm.lower + arm.upper) / 2
    q[1] = arm.upper[1] + 0.2  # the pose asks joint 2 to pass its limit; the last joints are short
    return arm, rd.control.inverse_kinematics(arm, arm.placement(q, "panda_link3"), frame="panda_link3")


def test_the_limit_that_holds_a_joint_is_named() -> None:
    """Joint 2 alone tilts link 3 that far; 0.2 rad are left."""
    arm, answer = answer_at_limit()
    assert not answer.converged and answer.first == 0 and len(answer.solutions) == 0
    assert any("upper limit of panda_joint2" in each for each in answer.held_by)
    assert (arm.lower <= answer.q).all() and (answer.q <= arm.upper).all()
    assert "panda_joint2" in repr(answer) and "does not reach" in repr(answer)


def test_out_of_reach_without_a_limit_is_said() -> None:
    arm = load("ur5")
    g = arm.placement(np.full(6, 0.3), "tool0").copy()
    g[:3, 3] = [2.0, 0.3, 0.4]
    answer = rd.control.inverse_kinematics(arm, g, frame="tool0")
    assert not answer.converged and not answer.held_by and "no joint limit is active" in repr(answer)
    assert answer.position_error > 1


def test_a_robot_arm_with_a_spherical_wrist_has_eight_solutions() -> None:
    """The UR5 has up to eight, apart from whole turns: two each of shoulder, elbow and wrist."""
    arm = load("ur5")
    q = np.array([0.3, -1.0, 1.2, -0.7, 0.9, 0.4])
    answer = rd.control.inverse_kinematics(arm, arm.placement(q, "tool0"), frame="tool0", q0=q + 0.05, starts=60)
    assert len(answer.solutions) == 8 and not answer.unique and answer.redundancy == 0
    np.testing.assert_allclose(answer.q, q, atol=1e-8)  # the nearest to q0


def test_joints_that_do_not_move_the_frame_stay_and_turns_are_the_nearest() -> None:
    arm, rng = load("kinova"), np.random.default_rng(4)
    frame = ARMS["kinova"]
    q0 = arm.random_configuration(rng) + 4 * np.pi * (np.isinf(arm.upper))
    answer = rd.control.inverse_kinematics(
        arm, arm.placement(q0 + 0.01 * np.sign(np.pi - q0), frame), frame=frame, q0=q0
    )
    assert answer.converged
    np.testing.assert_allclose(answer.q, q0, atol=0.05)
    panda = load("panda")
    q0 = panda.random_configuration(rng)
    assert (
        rd.control.inverse_kinematics(panda, panda.placement(q0, "panda_hand"), frame="panda_hand", q0=q0).q[-1]
        == q0[-1]
    )


def test_a_position_alone_leaves_the_orientation_free() -> None:
    arm = load("ur5")
    answer = rd.control.inverse_kinematics(arm, ([0.4, 0.2, 0.3], None), frame="tool0")
    assert answer.converged and np.isnan(answer.rotation_error) and answer.redundancy == 3
    np.testing.assert_allclose(arm.placement(answer.q, "tool0")[:3, 3], [0.4, 0.2, 0.3], atol=1e-9)


def test_answers_repeat() -> None:
    arm = load("ur5")
    g = arm.placement(np.full(6, 0.7), "tool0")
    first, again = (rd.control.inverse_kinematics(arm, (g[:3, 3], g[:3, :3]), frame="tool0", seed=5) for _ in range(2))
    np.testing.assert_array_equal(first.solutions, again.solutions)
    assert "solutions" in first.to_json()


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"frame": "tol0"}, QueryError, "no frame 'tol0'; nearest: tool0"),
        ({"q0": np.full(6, 9.0)}, PlanError, "shoulder_pan_joint at 9 is outside its limits"),
        ({"pose": 2 * np.eye(4)}, PlanError, "its last row must be 0 0 0 1"),
        ({"pose": ([0, 0, 0.5], 1.001 * np.eye(3))}, PlanError, r"RᵀR differs from 1 by 0\.002"),
        ({"pose": ([0, 0, 0.5], -np.eye(3))}, PlanError, "its determinant is −1"),
    ],
)
def test_what_is_no_pose_is_told(change: dict, error: type[Exception], message: str) -> None:
    arm = load("ur5")
    with pytest.raises(error, match=message):
        rd.control.inverse_kinematics(
            **{"arm": arm, "pose": arm.placement(np.zeros(6), "tool0"), "frame": "tool0"} | change
        )


@pytest.mark.long
def test_pink_reaches_the_same_poses() -> None:
    """Pink's own tasks, started beside a solution, descend to the pose that the answer is at: to 1e-6 in 200 steps."""
    pink = pytest.importorskip("pink")
    arm = load("ur5")
    rng = np.random.default_rng(6)
    for _ in range(10):
        q = rng.uniform(-2, 2, 6)
        g = arm.placement(q, "tool0")
        answer = rd.control.inverse_kinematics(arm, g, frame="tool0", q0=q + 0.02)
        configuration = pink.Configuration(arm.model, arm.model.createData(), q + 0.02)
        task = pink.FrameTask("tool0", position_cost=1.0, orientation_cost=1.0)
        task.set_target(pin.SE3(g))
        for _ in range(200):
            v = pink.solve_ik(configuration, [task], dt=0.1, solver="quadprog", limits=[])
            configuration.integrate_inplace(v, 0.1)
        np.testing.assert_allclose(configuration.q, answer.q, atol=1e-6)


def test_a_pose_in_millimetres_is_said_to_be_far_away() -> None:
    """Reach of a UR5 is 0.85 m: 400 mm read as 400 m is that far off; 1.2 m is not."""
    arm = load("ur5")
    far = repr(rd.control.inverse_kinematics(arm, ([400.0, 200.0, 300.0], np.eye(3)), frame="tool0", starts=4))
    near = repr(rd.control.inverse_kinematics(arm, ([1.2, 0.0, 0.3], np.eye(3)), frame="tool0", starts=4))
    assert "if the pose is in mm" in far and "in mm" not in near
    assert "1 rad counts as 1 m" in far and "1 rad counts as 1 m" in near
