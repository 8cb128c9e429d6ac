"""Inverse kinematics: answers reach the pose within the limits; what is out of reach is said, with its cause."""

from __future__ import annotations

import warnings

import numpy as np
import pinocchio as pin
import pytest

import robot_dyn as rd
from robot_dyn.control import InverseKinematics, orientation_error
from robot_dyn.control.pose import error_and_jacobian, logarithm
from robot_dyn.foundations import PlanError, QueryError, hat, rotation
from tests.long import long, stress

# kinova has continuous joints, panda a coupled one
ARMS = {"ur5": "tool0", "panda": "panda_hand", "kinova": "j2s6s200_end_effector", "xarm7": "link_eef", "z1": "link06"}
WITH_FIVE = ARMS | {"so100": "gripper"}  # so100 has five axes


SOME = ["ur5", "panda", *long(["z1"]), *stress(["kinova", "xarm7"])]


def load(name: str) -> rd.Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rd.ModelWarning)
        return rd.load(name)


def errors(arm: rd.Robot, frame: str, q: np.ndarray, g: np.ndarray) -> tuple[float, float]:
    """Distance and angle from a pose, by forward kinematics."""
    here = arm.placement(q, frame)
    turn = orientation_error(g[:3, :3], here[:3, :3])
    return float(np.linalg.norm(here[:3, 3] - g[:3, 3])), float(np.linalg.norm(turn))


def skew(a: np.ndarray, b: np.ndarray) -> float:
    """Angle between two unit vectors, accurate for small angles."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def directions_reached(name: str, poses: int) -> float:
    """The part of positions and directions of a random tool axis that were reached, judged by forward kinematics."""
    arm, frame, rng = load(name), WITH_FIVE[name], np.random.default_rng(1)
    converged = 0
    for seed in range(poses):
        g, a = arm.placement(arm.random_configuration(rng), frame), rng.normal(size=3)
        pose, a = (g[:3, 3], g[:3, :3] @ a), a / np.linalg.norm(a)
        answer = rd.control.inverse_kinematics(arm, pose, frame=frame, tool_axis=a, seed=seed)
        for q in answer.solutions:
            assert (arm.lower <= q).all() and (q <= arm.upper).all()
            here = arm.placement(q, frame)
            assert np.linalg.norm(here[:3, 3] - g[:3, 3]) <= 1e-9
            assert skew(here[:3, :3] @ a, g[:3, :3] @ a) <= 1.0001e-9  # two formulas of one angle, to rounding
        converged += answer.converged
    return converged / poses


@pytest.mark.parametrize(("name", "poses"), [("so100", 10), ("ur5", 10), *stress([(name, 200) for name in WITH_FIVE])])
def test_poses_with_the_spin_free_are_reached(name: str, poses: int) -> None:
    """All of 200 on arms with six or more joints; 194 on five axes, where 100 starts reach all."""
    assert directions_reached(name, poses) >= (0.95 if name == "so100" else 0.99)


def test_a_five_axis_arm_reaches_a_direction_where_no_full_pose_exists() -> None:
    """The pose of a position, turned by 1 rad about the tool axis: five joints cannot follow the spin."""
    arm, rng = load("ur5").with_(lock={"wrist_3_joint": 0.0}), np.random.default_rng(0)
    for _ in range(5):
        g = arm.placement(rng.uniform(-2, 2, 5), "tool0")
        full = rd.control.inverse_kinematics(
            arm, (g[:3, 3], g[:3, :3] @ rotation(np.array([0.0, 0.0, 1.0]), 1.0)), frame="tool0"
        )
        assert not full.converged and (full.conditions, full.moving_joints) == (6, 5)
        assert "5 joints move tool0" in repr(full)
        answer = rd.control.inverse_kinematics(arm, (g[:3, 3], g[:3, 2]), frame="tool0")
        assert answer.converged and (answer.conditions, answer.redundancy) == (5, 0)


def test_the_spin_about_the_direction_does_not_matter() -> None:
    """A sixth joint about the tool axis adds one direction of motion and keeps the error zero at each of its angles."""
    arm, q = load("ur5"), np.array([0.3, -1.0, 1.2, -0.7, 0.9, 0.4])
    g = arm.placement(q, "tool0")
    spun = q + 2.0 * np.eye(6)[5]
    answer = rd.control.inverse_kinematics(arm, (g[:3, 3], g[:3, 2]), frame="tool0", q0=spun)
    assert answer.converged and answer.redundancy == 1 and answer.first == 1
    np.testing.assert_allclose(answer.q, spun, atol=1e-9)  # no step is needed


def test_a_tool_that_points_backwards_turns_round() -> None:
    """At half a turn from the direction the shortest rotation is not unique, and the descent still leaves."""
    arm, q = load("ur5"), np.array([0.3, -1.0, 1.2, -0.7, 0.9, 0.4])
    g = arm.placement(q, "tool0")
    answer = rd.control.inverse_kinematics(arm, (g[:3, 3], -g[:3, 2]), frame="tool0", q0=q, starts=1)
    assert answer.rotation_error < 0.1  # of π; the point itself is out of reach from there


def test_a_direction_out_of_reach_is_refused() -> None:
    answer = rd.control.inverse_kinematics(load("ur5"), ([2.0, 0.3, 0.4], [0, 0, -1]), frame="tool0")
    assert not answer.converged and answer.position_error > 1 and not answer.limited_by and answer.conditions == 5


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


@pytest.mark.parametrize("offset", [1e-5, 1.0, 3.0])
def test_the_error_of_a_direction_falls_along_the_jacobian(offset: float) -> None:
    """d(½‖e‖²)/dq = −Jᵀ e at any distance; a central difference of step 1e-6 leaves 1e-9."""
    arm, rng = load("ur5"), np.random.default_rng(2)
    q, a = rng.uniform(-2, 2, 6), np.array([[0.6, 0.0, 0.8]])
    g = arm.placement(q + offset * rng.uniform(-1, 1, 6), "tool0")[None]

    def half_square(q: np.ndarray) -> float:
        e, _ = error_and_jacobian(arm, "tool0", g, q[None], a)
        return float(e[0] @ e[0]) / 2

    slope = [(half_square(q + d) - half_square(q - d)) / 2e-6 for d in 1e-6 * np.eye(6)]
    e, J = error_and_jacobian(arm, "tool0", g, q[None], a)
    np.testing.assert_allclose(slope, -J[0].T @ e[0], atol=1e-8)


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
    assert any("upper limit of panda_joint2" in each for each in answer.limited_by)
    assert (arm.lower <= answer.q).all() and (answer.q <= arm.upper).all()
    assert "panda_joint2" in repr(answer) and "does not reach" in repr(answer)


def test_out_of_reach_without_a_limit_is_said() -> None:
    arm = load("ur5")
    g = arm.placement(np.full(6, 0.3), "tool0").copy()
    g[:3, 3] = [2.0, 0.3, 0.4]
    answer = rd.control.inverse_kinematics(arm, g, frame="tool0")
    assert not answer.converged and not answer.limited_by and "no joint limit is active" in repr(answer)
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
        ({"pose": [0, 0, 0.5]}, PlanError, r"not a pair \(position, rotation or None\) must have shape \(4, 4\)"),
        ({"pose": ([0, 0, 0.5], [0, 0, 0])}, PlanError, "the direction of the pose must not be zero"),
        ({"pose": ([0, 0, 0.5], [0, 0, 1]), "tool_axis": np.zeros(3)}, PlanError, "tool_axis must not be zero"),
        ({"pose": ([0, 0, 0.5], [0, 1])}, PlanError, r"the rotation of the pose .* \(3, 3\) or \(3,\)"),
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
