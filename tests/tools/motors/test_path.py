"""rd.tools.motors.path: time-optimal motions against closed forms, phase-plane integration and the inverse dynamics."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import robot_dyn as rd
from robot_dyn.foundations import MissingExtraError, PlanError
from robot_dyn.tools.motors.planning.geometric_path import in_time, through
from tests.long import third

LIMITS = {"effort": 20.0, "velocity": 3.0}  # for arms whose files state none
WAY = np.array(  # the fourth and fifth joint reverse at one place
    [[0.0, -1.0, 1.2, 0.0, 0.5, 0.0], [0.6, -0.8, 0.9, 0.2, 0.4, 0.3], [1.2, -1.1, 1.1, -0.2, 0.6, 0.5]]
)
WITHOUT_GRAVITY = (0.0, 0.0, 0.0)
toppra = pytest.mark.skipif(find_spec("toppra") is None, reason="the extra plan")


ARMS, FRICTION = ("ur5", "panda", "kinova", "ur10", "xarm7"), ("none", "viscous and dry", "regularised")
SOME = [("ur5", "viscous and dry"), ("panda", "regularised"), ("kinova", "none")]


def _arm(name: str) -> rd.Robot:
    return rd.load(name).with_(lock={"panda_finger_joint1": 0.0}) if name == "panda" else rd.load(name)


def _way_points(robot: rd.Robot, seed: int, count: int = 5) -> np.ndarray:
    rng = np.random.default_rng(seed)
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    return (low + high) / 2 + rng.uniform(-0.25, 0.25, (count, robot.n)) * (high - low)


@toppra
@pytest.mark.parametrize(
    ("name", "friction"),
    [*SOME, *third(case for case in product(ARMS, FRICTION) if case not in SOME)],
)
def test_no_torque_is_above_its_limit_and_nearly_always_one_limit_binds(name: str, friction: str) -> None:
    """Inverse dynamics at 10 000 times, viscous friction of 20 % of the limit at full speed."""
    robot = _arm(name)
    viscous = rd.effects.ViscousFriction(0.2 * robot.effort_limit / robot.velocity_limit)
    effects = {
        "none": [],
        "viscous and dry": [viscous, rd.effects.DryFriction(0.05 * robot.effort_limit)],
        "regularised": [rd.effects.RegularisedCoulombFriction(0.05 * robot.effort_limit)],
    }[friction]
    plant = rd.Plant(robot, effects)
    found = rd.tools.motors.path(plant, _way_points(robot, seed=3))
    q, v, a = found.reference.at((np.arange(10_000) + 0.3) * found.duration_s / 10_000)
    torque = np.abs(plant.inverse_dynamics(q, v, a, t=0.0)) / robot.effort_limit
    speed = np.abs(v) / robot.velocity_limit
    assert torque.max() <= 1.001
    assert speed.max() <= 1.001
    assert (np.maximum(torque.max(axis=1), speed.max(axis=1)) >= 0.99).mean() >= 0.98
    assert sum(found.elsewhere.values()) == pytest.approx(1 - found.at_limits, abs=1e-12)


@toppra
def test_one_joint_between_two_points_takes_twice_the_square_root_of_distance_over_acceleration() -> None:
    """Double integrator: T = 2 √(d I / τ)."""
    robot = rd.load("simple_pendulum").with_(gravity=WITHOUT_GRAVITY)
    inertia = float(robot.M(np.array([0.3]))[0, 0])
    found = rd.tools.motors.path(robot, [[0.2], [1.7]], effort=2.5)
    assert found.duration_s == pytest.approx(2 * np.sqrt(1.5 * inertia / 2.5), rel=1e-4)


@toppra
def test_one_joint_with_viscous_friction_takes_the_time_of_its_linear_equation() -> None:
    """I v' + b v = ±τ, switched once: the sum of both times, from exponentials; the switch found by bisection.

    Pieces of constant acceleration end at the limit and start up to 1 % below it, which takes some 1e-3 of the time.
    """
    robot = rd.load("simple_pendulum").with_(gravity=WITHOUT_GRAVITY)
    inertia, b, tau, distance = float(robot.M(np.array([0.3]))[0, 0]), 0.4, 1.0, 2.3
    rate, most = b / inertia, tau / b

    def motion(t1: float) -> tuple[float, float]:
        """Time and way if the torque changes its sign at t1."""
        v1 = most * (1 - np.exp(-rate * t1))
        t2 = np.log(1 + v1 / most) / rate
        return t1 + t2, most * t1 - v1 / rate + (v1 / rate - most * t2)

    low, high = 0.0, 100.0
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if motion(middle)[1] < distance else (low, middle)
    plant = rd.Plant(robot, [rd.effects.ViscousFriction(b)])
    found = rd.tools.motors.path(plant, [[-1.0], [-1.0 + distance]], effort=tau)
    assert found.duration_s == pytest.approx(motion(low)[0], rel=2e-3)
    assert found.duration_s > motion(low)[0]  # nothing is faster than the optimum


@toppra
def test_a_planar_arm_takes_the_time_of_the_phase_plane() -> None:
    """Forward at the greatest s̈, backward at the least, until both meet: Bobrow's method, by another code."""
    robot = rd.load("planar_2r")
    limits, ends = np.array([60.0, 20.0]), np.array([[0.3, 0.4], [0.9, 0.1]])
    path = through(ends)

    def extreme(s: float, x: float, sign: int) -> float:
        q, slope, bend = path.at(np.float64(s))
        rest = robot.inverse_dynamics(q, slope * np.sqrt(max(x, 0.0)), bend * x)
        A = robot.M(q) @ slope
        bounds = (sign * np.sign(A) * limits - rest) / A
        return bounds.min() if sign > 0 else bounds.max()

    tight = {"rtol": 1e-10, "atol": 1e-14, "dense_output": True, "max_step": path.breaks[-1] / 50}
    forward = solve_ivp(lambda s, x: [2 * extreme(s, x[0], 1)], (0.0, path.breaks[-1]), [1e-12], **tight).sol
    backward = solve_ivp(lambda s, x: [2 * extreme(s, x[0], -1)], (path.breaks[-1], 0.0), [1e-12], **tight).sol
    r = np.linspace(0, 1, 20_001)
    s = path.breaks[-1] * (3 * r**2 - 2 * r**3)  # ds/√x stays finite at rest
    x = np.minimum(forward(s)[0], backward(s)[0])
    inside = slice(1, -1)
    rate = path.breaks[-1] * 6 * (r - r**2)[inside] / np.sqrt(x[inside])
    duration = np.concatenate([[rate[0]], rate, [rate[-1]]])
    found = rd.tools.motors.path(robot, ends, effort=limits)
    assert found.duration_s == pytest.approx(float(np.trapezoid(duration, r)), rel=1e-3)


def test_the_motion_is_the_path_with_the_speed_exactly() -> None:
    """q(s(t)), q' ṡ and q' s̈ + q'' ṡ², to the rounding of polynomials of degree 6."""
    path = through(np.random.default_rng(5).uniform(-1, 1, (4, 3)))
    s = np.unique(np.concatenate([path.breaks, np.linspace(0, path.breaks[-1], 40)]))
    x = 0.3 + np.cos(2.1 * s) ** 2
    motion = in_time(path, s, x)
    u = np.diff(x) / (2 * np.diff(s))
    t = np.random.default_rng(6).uniform(0, motion.end_s, 200)
    k = np.searchsorted(motion.breaks, t, side="right") - 1
    h = t - motion.breaks[k]
    at, speed = s[k] + np.sqrt(x[k]) * h + u[k] / 2 * h**2, np.sqrt(x[k]) + u[k] * h
    q, slope, bend = path.at(at)
    expected = q, slope * speed[:, None], slope * u[k][:, None] + bend * (speed**2)[:, None]
    for given, wanted in zip(motion.at(t), expected, strict=True):
        np.testing.assert_allclose(given, wanted, rtol=0, atol=1e-12)


@toppra
def test_a_run_follows_the_plan_that_leaves_a_share_of_the_limits() -> None:
    """With friction in the plant that the controller's model lacks: feedback stays within what the plan left.

    No effort limit acts, so that none hides what is asked for. A PD of stiffness K lags by friction/K: 30/4000 at
    the shoulder at most, 5.6/800 at the wrist; 2e-2 allows for speeds that change within the time constant.
    """
    arm = rd.load("ur5").with_(payload=rd.Payload("tool0", 2.0))
    plant = rd.Plant(arm, [rd.effects.ViscousFriction(0.2 * arm.effort_limit / arm.velocity_limit)])
    found = rd.tools.motors.path(plant, WAY, fraction=0.95, velocity=0.98 * arm.velocity_limit)
    gains = [4000.0] * 3 + [800.0] * 3, [160.0] * 3 + [16.0] * 3
    controller = rd.control.FeedForward(arm, found.reference, kp=gains[0], kd=gains[1])
    run = rd.simulate(
        plant,
        WAY[0],
        duration_s=found.duration_s,
        controller=controller,
        method="RK4",
        step_s=2e-3,
        engine="interpreted",
        estimate_error=False,
    )
    assert run.extremes is not None and run.desired is not None
    _, speed, torque = np.abs(run.extremes).max(axis=1)  # over all steps
    assert 0.9 < (torque / arm.effort_limit).max() <= 1  # the plan is at its limits, the run within those of the motors
    assert (speed <= arm.velocity_limit).all()
    np.testing.assert_allclose(run.q, run.desired, rtol=0, atol=2e-2)


@toppra
def test_more_torque_is_faster_and_the_path_is_the_same() -> None:
    robot = rd.load("ur5")
    points = _way_points(robot, seed=8)
    slow, fast = (rd.tools.motors.path(robot, points, fraction=share) for share in (0.6, 1.0))
    assert fast.duration_s < slow.duration_s
    passed = fast.reference.at(np.linspace(0, fast.duration_s, 20_000))[0]
    for point in points:
        assert np.abs(passed - point).max(axis=1).min() < 2e-3  # what it moves in 1/20 000 of the time


@toppra
def test_a_polynomial_counts_as_a_path_alone() -> None:
    robot = rd.load("planar_2r")
    slow = rd.control.PiecewisePolynomial([0.0, 100.0], [[[0.1, 0.2], [0.01, -0.02], [1e-5, 3e-5]]])
    once = rd.control.PiecewisePolynomial([5.0, 6.0], [[[0.1, 0.2], [1.0, -2.0], [0.1, 0.3]]])
    first, second = (rd.tools.motors.path(robot, each, effort=60.0) for each in (slow, once))
    assert first.duration_s == pytest.approx(second.duration_s, rel=1e-4)


@pytest.mark.parametrize(
    ("effect", "named"),
    [
        (rd.effects.LuGreFriction(1e4, 10.0, 0.4, 1.0, 1.5, 0.1), "lugre_friction"),
        (rd.effects.ActuatorLag(0.01), "actuator_lag"),
        (rd.effects.CarriedPayload(rd.Payload("tool0", 1.0), 0.1, 0.2), "carried_payload"),
        (rd.effects.ExternalWrench("tool0", [1.0, 2.0, 3.0, 0.1, 0.2, 0.3], end_s=1.0), "external_wrench"),
    ],
)
def test_what_depends_on_time_or_has_states_is_refused_by_name(effect: rd.effects.Effect, named: str) -> None:
    plant = rd.Plant(rd.load("ur5"), [effect])
    with pytest.raises(PlanError, match=named):
        rd.tools.motors.path(plant, np.array([[0.1] * 6, [0.5] * 6]))


@pytest.mark.parametrize(
    ("name", "points", "options", "said"),
    [
        ("ur5", [[0.1] * 6], {}, "2 to 2000"),
        ("ur5", [[0.1] * 5] * 2, {}, "shape"),
        ("ur5", [[0.1] * 6, [0.1] * 6, [0.3] * 6], {}, "equal"),
        ("planar_2r", [[0.3, -0.4], [0.7, 1e308]], {}, r"points must be within 1e\+100 rad or m, got 1e\+308"),
        ("ur5", [[0.1] * 6, [9.0] * 6], {}, "outside its limits"),
        ("ur5", [[0.1] * 6, [0.5] * 6], {"fraction": 1.2}, "at most 1"),
        ("ur5", [[0.1] * 6, [0.5] * 6], {"effort": {"elbow": 3.0}}, "elbow"),
        ("ur5", [[0.1] * 6, [0.5] * 6], {"effort": 3.0}, "'shoulder_lift_joint' needs"),
        ("planar_2r", [[0.1] * 2, [0.5] * 2], {}, "nothing limits"),
    ],
)
def test_a_path_that_cannot_be_planned_says_why(name: str, points: list[list[float]], options: dict, said: str) -> None:
    with pytest.raises(rd.RobotDynError, match=said):
        rd.tools.motors.path(rd.load(name), np.array(points), **options)


def test_a_spline_outside_the_limits_between_points_inside_is_refused_or_a_finding() -> None:
    """The points are at the limit of a joint and its neighbour moves on: a spline passes the limit between them."""
    arm = _arm("panda")
    points = np.tile((arm.lower + arm.upper) / 2, (4, 1)) + 0.2 * np.arange(4.0)[:, None] * (np.arange(7) == 0)
    points[1:3, 1] = arm.upper[1] - 1e-3
    assert ((points >= arm.lower) & (points <= arm.upper)).all()
    with pytest.raises(PlanError, match=r"panda_joint2 is at .* outside its limits"):
        rd.tools.motors.path(arm, points)
    spline = rd.control.via_points([0.0, 1.0, 2.0, 3.0], points)
    assert sum("outside its limits" in finding for finding in rd.tools.motors.budget(spline, arm).findings) == 1


@toppra
def test_a_path_near_the_edge_of_the_workspace_is_within_limits_between_the_times_of_its_check() -> None:
    """An elbow within 0.03 rad of straight, at 50 001 times; the check itself allows 1.001 at 10 000 times."""
    arm = _arm("panda")
    points = _way_points(arm, seed=3)
    points[:, 3] = -0.12 + 0.03 * np.array([0.0, 1.0, -1.0, 0.5, -0.5])
    plan = rd.tools.motors.path(arm, points)
    q, v, a = plan.reference.at(np.linspace(0, plan.duration_s, 50_001))
    assert np.abs(v / arm.velocity_limit).max() <= 1.001
    assert np.abs(arm.inverse_dynamics(q, v, a) / arm.effort_limit).max() <= 1.001
    assert ((q >= arm.lower) & (q <= arm.upper)).all()


@pytest.mark.parametrize("package", ["toppra", "ruckig"])
def test_without_its_extra_a_motion_says_the_line_that_installs_it(package: str, monkeypatch) -> None:
    for name in [name for name in sys.modules if name.startswith("toppra.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    arm, (q0, q1) = rd.load("ur5"), np.array([[0.1] * 6, [0.5] * 6])
    needed = rd.tools.motors.budget(rd.control.quintic(q0, q1, 1.0), arm)
    for motion in {
        "toppra": (lambda: rd.tools.motors.path(arm, [q0, q1]), lambda: rd.tools.motors.fastest(needed)),
        "ruckig": (lambda: rd.tools.motors.point_to_point(arm, q0, q1, acceleration=3.0, jerk=20.0),),
    }[package]:
        with pytest.raises(MissingExtraError, match=rf"{package}.* is not installed: pip install 'robot-dyn\[plan\]'"):
            motion()


@toppra
def test_a_plan_tells_which_limit_binds_when(tmp_path: Path) -> None:
    robot = rd.load("ur5")
    found = rd.tools.motors.path(robot, _way_points(robot, seed=3))
    text = repr(found)
    assert f"{found.duration_s:.6g} s" in text
    assert "shoulder_pan_joint" in text
    assert found.phases[0].start_s == pytest.approx(0.0, abs=0.01 * found.duration_s)
    pairs = zip(found.phases, found.phases[1:], strict=False)
    assert all(first.end_s <= second.start_s + 1e-12 for first, second in pairs)
    assert "<svg" in found.drawing
    assert '"at_limits"' in found.to_json()


@toppra
def test_joints_that_reverse_at_one_place_are_planned() -> None:
    """In proportion, so that the roots of their slopes differ by rounding: that is no cell of the grid."""
    robot = rd.load("ur5")
    found = rd.tools.motors.path(rd.Plant(robot, [rd.effects.DryFriction(5.0)]), WAY)
    assert found.largest <= 1.001 and found.at_limits >= 0.98
    assert np.diff(found.reference.breaks).min() > 1e-9 * found.duration_s
