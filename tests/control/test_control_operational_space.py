"""Control of a frame: Λ ẍ + μ + p = F, the torque it leaves free, and what happens at a singularity."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import robot_dyn as rd
from robot_dyn.control import (
    POSE,
    POSITION,
    OperationalSpace,
    TaskDynamics,
    circle,
    hold,
    line,
    orientation_error,
    task_dynamics,
)
from robot_dyn.foundations import ControlError, QueryError, rotation

NONE = np.zeros(0)
PANDA = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
UR5, PLANAR = rd.load("ur5"), rd.load("planar_2r")
CASES = {
    "panda pose": (PANDA, "panda_hand_tcp", POSE),
    "panda position": (PANDA, "panda_hand_tcp", POSITION),
    "ur5 pose": (UR5, "tool0", POSE),
    "ur5 height and yaw": (UR5, "tool0", (2, 5)),
    "planar_2r": (PLANAR, "tip", (0, 2)),
}
EXACT = 1e-12  # a threshold that no regular state reaches


def state(robot: rd.Robot, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A state away from singularities: the elbow is bent."""
    bent = np.resize([0.3, -0.9, 0.4, -1.6, 0.8, 1.2, 0.3], robot.n)
    return bent + np.linspace(-0.4, 0.5, robot.n), np.random.default_rng(seed).normal(size=robot.n)


def task_acceleration(robot: rd.Robot, frame: str, rows: tuple[int, ...], q, v, tau) -> np.ndarray:
    """ẍ = J a + J̇ v of the true arm under a torque."""
    a = robot.forward_dynamics(q, v, tau)
    return robot.jacobian(q, frame)[list(rows)] @ a + robot.jacobian_rate(q, v, frame)[list(rows)] @ v


@pytest.mark.parametrize(("robot", "frame", "rows"), CASES.values(), ids=CASES)
def test_task_obeys_its_equation_of_motion(robot: rd.Robot, frame: str, rows: tuple[int, ...]) -> None:
    """Λ ẍ + μ + p = F for any τ = Jᵀ F: 1e-10 of the terms, as Λ amplifies rounding by the condition of J M⁻¹ Jᵀ."""
    q, v = state(robot)
    task = task_dynamics(robot, q, v, frame, rows=rows, threshold=EXACT)
    for F in np.random.default_rng(1).normal(size=(3, len(rows))) * 20:
        acceleration = task_acceleration(robot, frame, rows, q, v, task.J.T @ F)
        scale = np.abs(task.Lambda) @ np.abs(acceleration) + np.abs(task.mu) + np.abs(task.p) + np.abs(F)
        assert (np.abs(task.Lambda @ acceleration + task.mu + task.p - F) <= 1e-10 * scale).all()


@pytest.mark.parametrize(("robot", "frame", "rows"), CASES.values(), ids=CASES)
def test_task_terms_are_those_of_the_book(robot: rd.Robot, frame: str, rows: tuple[int, ...]) -> None:
    """Khatib's formulas with a general inverse; 1e-9 of the largest entry for the condition numbers of some 1e5."""
    q, v = state(robot)
    task = task_dynamics(robot, q, v, frame, rows=rows, threshold=EXACT)
    J, J_rate = robot.jacobian(q, frame)[list(rows)], robot.jacobian_rate(q, v, frame)[list(rows)]
    M_inverse = np.linalg.inv(robot.M(q))
    Lambda = np.linalg.inv(J @ M_inverse @ J.T)
    J_bar = M_inverse @ J.T @ Lambda
    expected = {
        "Lambda": Lambda,
        "J_bar": J_bar,
        "mu": J_bar.T @ robot.C(q, v) @ v - Lambda @ J_rate @ v,
        "p": J_bar.T @ robot.N(q),
        "projector": np.eye(robot.n) - J.T @ J_bar.T,
    }
    for name, value in expected.items():
        got = getattr(task, name)
        np.testing.assert_allclose(got, value, atol=1e-9 * max(1.0, np.abs(value).max()), err_msg=name)
    np.testing.assert_allclose(J @ task.J_bar, np.eye(len(rows)), atol=1e-10)


@pytest.mark.parametrize("case", ["panda pose", "panda position", "ur5 height and yaw"])
def test_null_space_torque_gives_no_task_acceleration(case: str) -> None:
    """J M⁻¹ (1 − Jᵀ J̄ᵀ) τ₀ = 0, 1e-10 of what τ₀ itself would do; and it is a projector."""
    robot, frame, rows = CASES[case]
    q, v = state(robot)
    task = task_dynamics(robot, q, v, frame, rows=rows, threshold=EXACT)
    tau = np.random.default_rng(2).normal(size=robot.n)
    with_it = task_acceleration(robot, frame, rows, q, v, task.projector @ tau)
    without = task_acceleration(robot, frame, rows, q, v, 0 * tau)
    all_of_it = task_acceleration(robot, frame, rows, q, v, tau)
    assert np.abs(task.projector @ tau).max() > 0.01
    np.testing.assert_allclose(with_it, without, atol=1e-10 * np.abs(all_of_it).max())
    np.testing.assert_allclose(task.projector @ task.projector, task.projector, atol=1e-10)


def test_task_dynamics_takes_batches() -> None:
    robot, frame, rows = CASES["panda pose"]
    q, v = np.stack([np.stack(state(robot, seed)) + 0.1 * seed for seed in range(3)], axis=1)
    batch = task_dynamics(robot, q, v, frame, rows=rows)
    for i in range(3):
        one = task_dynamics(robot, q[i], v[i], frame, rows=rows)
        for name in TaskDynamics.__dataclass_fields__:
            np.testing.assert_allclose(getattr(batch, name)[i], getattr(one, name), rtol=1e-10, atol=1e-10)


def general_pose(robot: rd.Robot, frame: str, q: np.ndarray):
    """A line and a turn that start near the pose at q."""
    g = robot.placement(q, frame)
    R = rotation(np.array([0.6, 0.0, 0.8]), 0.4) @ g[:3, :3]
    R_end = rotation(np.array([0.0, 1.0, 0.0]), 0.7) @ R
    return line(g[:3, 3] + [0.05, -0.02, 0.03], g[:3, 3] + [-0.1, 0.2, 0.1], 1.0, rotation=R, rotation_end=R_end)


@pytest.mark.parametrize("case", ["panda pose", "ur5 pose"])
def test_with_the_exact_model_the_task_error_is_linear(case: str) -> None:
    """ẍ = ẍ_d + kd ė + kp e, posture or not: 1e-9 of it, for the condition of J M⁻¹ Jᵀ."""
    robot, frame, rows = CASES[case]
    q, v = state(robot)
    reference, kp, kd = general_pose(robot, frame, q), np.linspace(60, 120, 6), np.linspace(12, 20, 6)
    controller = OperationalSpace(
        robot, frame, reference, kp=kp, kd=kd, posture=0.4 * q, posture_kp=25.0, posture_kd=10.0, threshold=EXACT
    )
    p_d, R_d, twist_d, rate_d = reference.at(0.3)
    g, twist = robot.placement(q, frame), robot.jacobian(q, frame) @ v
    e = np.concatenate([p_d - g[:3, 3], orientation_error(R_d, g[:3, :3])])
    expected = rate_d + kd * (twist_d - twist) + kp * e
    got = task_acceleration(robot, frame, rows, q, v, controller.torque(0.3, q, v, NONE))
    np.testing.assert_allclose(got, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("case", ["panda pose", "panda position"])
def test_what_the_task_leaves_free_goes_to_the_posture(case: str) -> None:
    """For J u = 0: uᵀ M a = uᵀ M (posture_kp (q_p − q) − posture_kd v), since uᵀ Jᵀ = 0; 1e-11 of the torques."""
    robot, frame, rows = CASES[case]
    q, v = state(robot)
    posture_kp, posture_kd = np.linspace(20, 30, 7), np.linspace(9, 12, 7)
    options = {"posture": 0.4 * q, "posture_kp": posture_kp, "posture_kd": posture_kd, "rows": rows}
    controller = OperationalSpace(robot, frame, general_pose(robot, frame, q), kp=80.0, kd=15.0, **options)
    tau = controller.torque(0.3, q, v, NONE)
    M, a = robot.M(q), robot.forward_dynamics(q, v, tau)
    free = np.linalg.svd(robot.jacobian(q, frame)[list(rows)])[2][len(rows) :]
    expected = free @ M @ (posture_kp * (0.4 * q - q) - posture_kd * v)
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(free @ M @ a, expected, atol=1e-11 * np.abs(tau).max())


def test_position_task_follows_a_circle_and_the_posture_takes_the_rest() -> None:
    """ω = 20 rad/s from the exact start: what is left is the integrator's error, some steps of 1e-6: below 1e-5 m."""
    robot, frame, _ = CASES["panda position"]
    q0 = state(robot)[0]
    start = robot.placement(q0, frame)[:3, 3]
    x = np.array([10.0, 0.0, -3.0]) / np.sqrt(109)  # x, projected onto the plane of the circle
    reference = circle(start - 0.1 * x, 0.1, [0.3, 0.0, 1.0], 0.8, turns=0.5, toward=x)
    np.testing.assert_allclose(reference.at(0.0)[0], start, atol=1e-15)
    controller = OperationalSpace(
        robot, frame, reference, kp=400.0, kd=40.0, posture=q0, posture_kp=100.0, posture_kd=20.0
    )
    n = robot.n

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        return np.concatenate([x[n:], robot.forward_dynamics(x[:n], x[n:], controller.torque(t, x[:n], x[n:], NONE))])

    run = solve_ivp(rate, (0, 0.6), np.concatenate([q0, 0 * q0]), rtol=1e-6, atol=1e-8, method="RK45")
    p = robot.placement(run.y[:n].T, frame)[:, :3, 3]
    assert np.abs(p - reference.at(run.t)[0]).max() < 1e-5
    assert np.abs(p - start).max() > 0.1  # it did move


@pytest.mark.parametrize(
    ("robot", "frame", "rows", "straight", "bend"),
    [
        (UR5, "tool0", POSE, [0.3, -0.9, 0.0, 0.6, 0.0, 0.2], [0, 0, 1, 0, 1, 0]),  # elbow and wrist at once
        (UR5, "wrist_1_link", POSITION, [0.3, -0.9, 0.0, 0.6, 0.5, 0.2], [0, 0, 1, 0, 0, 0]),
        (PLANAR, "tip", (0, 2), [0.4, 0.0], [0, 1]),
    ],
    ids=["ur5 pose", "ur5 wrist", "planar_2r"],
)
def test_torque_is_bounded_near_the_straight_arm(robot: rd.Robot, frame: str, rows, straight, bend) -> None:
    """τ_xᵀ M⁻¹ τ_x ≤ ‖ẍ* − J̇ v‖²/ε however near the singularity, where the plain inverse has no bound.

    At the straight arm the smallest eigenvalue is 0 to rounding; towards it the torque has a limit.
    """
    epsilon, v, desired = 0.01, np.linspace(0.5, -0.4, robot.n), np.linspace(3.0, -5.0, len(rows))
    assert task_dynamics(robot, straight, v, frame, rows=rows).smallest < 1e-10
    torques, undamped = [], []
    for angle in [0.0, 1e-12, 1e-8, 1e-5, 1e-3, 1e-2, 0.05, 0.1, 0.3]:
        q = np.array(straight) + angle * np.array(bend)
        task = task_dynamics(robot, q, v, frame, rows=rows, threshold=epsilon)
        tau = task.J.T @ task.Lambda @ (desired - task.drift)
        assert tau @ np.linalg.solve(robot.M(q), tau) <= (1 + 1e-9) * ((desired - task.drift) ** 2).sum() / epsilon
        assert np.linalg.eigvalsh(task.Lambda).max() <= (1 + 1e-9) / epsilon
        plain = task_dynamics(robot, q, v, frame, rows=rows, threshold=1e-30)
        torques.append(tau)
        undamped.append(plain.J.T @ plain.Lambda @ (desired - plain.drift))
    assert np.abs(undamped[3]).max() > 100 * np.abs(torques).max()
    np.testing.assert_allclose(torques[2], torques[0], atol=1e-3 * np.abs(torques).max())


@pytest.mark.parametrize("angle", [0.0, 1e-6, 0.01])
def test_controller_near_the_straight_arm_asks_for_no_more_than_its_task(angle: float) -> None:
    """The whole torque less C v + N and the posture is the bounded τ_x: 1e-9 of it, and finite at the singularity."""
    q, v = np.array([0.4, angle]), np.array([0.5, -0.4])
    reference = line([0.3, 0.2, 0.0], [-0.5, 0.9, 0.0], 1.0)
    controller = OperationalSpace(PLANAR, "tip", reference, kp=50.0, kd=10.0, rows=(0, 1))
    task, desired = task_dynamics(PLANAR, q, v, "tip", rows=(0, 1)), controller.task_acceleration(0.5, q, v)
    tau = controller.torque(0.5, q, v, NONE) - PLANAR.inverse_dynamics(q, v, 0 * q)
    np.testing.assert_allclose(tau, task.J.T @ task.Lambda @ (desired - task.drift), atol=1e-9 * np.abs(tau).max())
    assert tau @ np.linalg.solve(PLANAR.M(q), tau) <= ((desired - task.drift) ** 2).sum() / 0.01


def test_away_from_the_singularity_nothing_is_damped() -> None:
    robot, frame, rows = CASES["planar_2r"]
    q, v = np.array([0.4, 1.2]), np.array([0.3, -0.8])
    damped = task_dynamics(robot, q, v, frame, rows=rows)
    assert damped.smallest > 0.01
    np.testing.assert_array_equal(damped.Lambda, task_dynamics(robot, q, v, frame, rows=rows, threshold=EXACT).Lambda)


def test_at_the_straight_arm_the_other_direction_stays_exact() -> None:
    """The eigenvector of J M⁻¹ Jᵀ with s > ε accelerates as it is told, 1e-10; along the other nothing is asked."""
    robot, frame, rows = CASES["planar_2r"]
    q, v = np.array([0.4, 0.0]), np.array([0.3, -0.8])
    task = task_dynamics(robot, q, v, frame, rows=rows)
    across, along = np.array([-np.sin(0.4), np.cos(0.4)]), np.array([np.cos(0.4), np.sin(0.4)])
    F = task.Lambda @ (2.5 * across + 7.0 * along) + task.mu + task.p
    tau = task.J.T @ F + task.projector @ robot.inverse_dynamics(q, v, 0 * q)
    assert across @ task_acceleration(robot, frame, rows, q, v, tau) == pytest.approx(2.5, rel=1e-10)
    np.testing.assert_allclose(task.Lambda @ along, 0, atol=1e-10)


R_HOLD = line([0.1, 0.2, 0.3], [0.4, 0.5, 0.6], 1.0, rotation=np.eye(3))
FREE = line([0.1, 0.2, 0.3], [0.4, 0.5, 0.6], 1.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: OperationalSpace(PANDA, "panda_hand", hold([0.0] * 7), kp=1.0, kd=1.0),
            "reference must be a Cartesian",
        ),
        (
            lambda: OperationalSpace(PANDA, "panda_hand", FREE, kp=1.0, kd=1.0, rows=POSE),
            "the reference leaves it free",
        ),
        (lambda: OperationalSpace(PANDA, "panda_hand", FREE, kp=1.0, kd=1.0, rows=(1, 0)), "rows must be increasing"),
        (lambda: OperationalSpace(PANDA, "panda_hand", FREE, kp=1.0, kd=1.0, rows=(0.5,)), "rows must be increasing"),
        (
            lambda: OperationalSpace(PANDA, "panda_hand", R_HOLD, kp=[1.0] * 3, kd=1.0),
            r"kp must be one number or of shape \(6,\)",
        ),
        (lambda: OperationalSpace(PANDA, "panda_hand", FREE, kp=1.0, kd=-1.0), "kd must not be negative"),
        (
            lambda: OperationalSpace(PANDA, "panda_hand", FREE, kp=1.0, kd=1.0, posture_kp=2.0),
            "posture_kp needs a posture",
        ),
        (lambda: OperationalSpace(PANDA, "panda_hand", FREE, kp=1.0, kd=1.0, posture=[0.0]), "posture must have shape"),
        (
            lambda: OperationalSpace(PANDA, "panda_hand", FREE, kp=1.0, kd=1.0, threshold=0.0),
            "threshold must be positive",
        ),
    ],
)
def test_task_controllers_without_meaning_are_refused(make, message: str) -> None:
    with pytest.raises(ControlError, match=message):
        make()


def test_an_unknown_frame_is_told_at_once() -> None:
    with pytest.raises(QueryError, match="panda_hand"):
        OperationalSpace(PANDA, "panda_hnad", FREE, kp=1.0, kd=1.0)
