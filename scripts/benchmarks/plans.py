"""Planned motions against their laws, on five arms: ruckig's own values, limits at 10 000 times, poses reached.

pin-pink, where it is installed, descends from the same first start to the same poses.
"""

from __future__ import annotations

import warnings
from functools import cache
from importlib.util import find_spec
from time import perf_counter
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]

import robot_dyn as rd
from benchmarks.measure import Effort, row, table
from robot_dyn.foundations.extras import needs

# the frame of each arm that is brought to poses; kinova has continuous joints, panda two coupled fingers
FRAMES = {"ur5": "tool0", "panda": "panda_hand", "kinova": "j2s6s200_end_effector", "xarm7": "link_eef", "z1": "link06"}
VISCOUS, DRY, SPRING = 0.2, 0.05, 0.1  # of the effort limit: at full speed; at all speeds; a radian from the middle
REACHED = 1e-9  # [m] and [rad]
PINK_STEPS, PINK_DT, PINK_REACHED = 500, 0.1, 1e-6


@cache
def arm(name: str) -> rd.Robot:
    """The arm of a file; the fingers of panda are coupled."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rd.ModelWarning)
        return rd.load(name)


def installed(*modules: str) -> bool:
    """Whether all modules are; those that are not are named."""
    missing = [each for each in modules if find_spec(each) is None]
    if missing:
        print(f"\nnot installed: {', '.join(missing)}")
    return not missing


def point_to_point(effort: Effort) -> None:
    """Pieces of `rd.tools.motors.point_to_point` beside ruckig's own evaluation at 100 times of each motion."""
    if not installed("ruckig"):
        return
    ruckig, motions = needs("ruckig", extra="plan"), 3 if effort.quick else 200
    table("arm", "motions", "q differs by, rad", "v, rad/s", "a, rad/s²", "duration, s")
    for name in FRAMES:
        robot, rng = arm(name), np.random.default_rng(1)
        worst = np.zeros(4)
        for _ in range(motions):
            ends = np.array([robot.random_configuration(rng) for _ in range(2)])
            limits = robot.velocity_limit, rng.uniform(1, 9, robot.n), rng.uniform(5, 80, robot.n)
            plan = rd.tools.motors.point_to_point(robot, *ends, acceleration=limits[1], jerk=limits[2])
            asked, its = ruckig.InputParameter(robot.n), ruckig.Trajectory(robot.n)
            asked.current_position, asked.target_position = ends
            asked.max_velocity, asked.max_acceleration, asked.max_jerk = limits
            ruckig.Ruckig(robot.n).calculate(asked, its)
            t = rng.uniform(0, its.duration, 100)
            expected = np.array([its.at_time(x)[:3] for x in t]).swapaxes(0, 1)
            off = [np.abs(x - y).max() for x, y in zip(plan.reference.at(t), expected, strict=True)]
            worst = np.maximum(worst, [*off, abs(plan.duration_s - its.duration)])
        row(name, motions, *(f"{x:.1e}" for x in worst))


def effects(robot: rd.Robot) -> dict[str, list[rd.effects.Effect]]:
    """What acts beside the rigid bodies and gravity."""
    most = robot.effort_limit
    viscous = rd.effects.ViscousFriction(VISCOUS * most / robot.velocity_limit)
    dry, middle = rd.effects.DryFriction(DRY * most), np.clip(0.0, robot.lower, robot.upper)
    return {
        "none": [],
        f"viscous friction, {VISCOUS:.0%}": [viscous],
        f"and dry friction, {DRY:.0%}": [viscous, dry],
        f"and a spring, {SPRING:.0%}/rad": [viscous, dry, rd.effects.Spring(SPRING * most, middle)],
    }


def paths(effort: Effort) -> None:
    """The fastest motions along random paths of 5 points, judged anew by Pinocchio's inverse dynamics and effects."""
    if not installed("toppra"):
        return
    arms, count = (("z1",), 1) if effort.quick else (tuple(FRAMES), 10)
    head = "arm", "what", "paths", "torque/limit, most", "speed/limit, most", "at a limit, least", "median"
    table(*head, "no reason known, most", "s to plan, median")
    for name in arms:
        robot = arm(name)
        robot = robot.with_(lock={"panda_finger_joint1": 0.0}) if name == "panda" else robot
        for acting, each in effects(robot).items():
            figures = np.array([_judged(rd.Plant(robot, each), _points(robot, seed)) for seed in range(count)])
            torque, speed, _, unknown, _ = figures.max(axis=0)
            least, middle = figures[:, 2].min(), np.median(figures, axis=0)
            shown = f"{torque:.5f}", f"{speed:.5f}", f"{least:.2%}", f"{middle[2]:.2%}", f"{unknown:.2%}"
            row(name, acting, count, *shown, f"{middle[4]:.1f}")


def _points(robot: rd.Robot, seed: int) -> np.ndarray:
    """Way points in the middle half of the limits, (5, n)."""
    rng = np.random.default_rng(seed)
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    return (low + high) / 2 + rng.uniform(-0.25, 0.25, (5, robot.n)) * (high - low)


def _judged(plant: rd.Plant, points: np.ndarray) -> tuple[float, ...]:
    """Largest torque and speed, share of time at a limit, share without a known reason, and seconds to plan."""
    robot: Any = plant.dynamics
    began = perf_counter()
    found = rd.tools.motors.path(plant, points)
    seconds = perf_counter() - began
    q, v, a = found.reference.at((np.arange(10_000) + 0.3) * found.duration_s / 10_000)
    torque = np.abs(robot.inverse_dynamics(q, v, a) - plant.torque(q, v, t=0.0)) / robot.effort_limit
    speed = np.abs(v) / robot.velocity_limit
    at_limit = (np.maximum(torque.max(axis=1), speed.max(axis=1)) >= 0.99).mean()
    return torque.max(), speed.max(), at_limit, found.elsewhere.get("no reason known", 0.0), seconds


def poses(effort: Effort) -> None:
    """Poses at random positions within the limits: how many are reached, from which start on, and by pin-pink."""
    count = 3 if effort.quick else 1000
    table("arm", "poses", "reached", "starts, median", "99 %", "most", "error, m and rad, most", "ms a pose, median")
    for name, frame in FRAMES.items():
        robot, rng = arm(name), np.random.default_rng(1)
        first, worst, times = [], 0.0, []
        for seed in range(count):
            g = robot.placement(robot.random_configuration(rng), frame)
            began = perf_counter()
            answer = rd.control.inverse_kinematics(robot, g, frame=frame, seed=seed)
            times.append(perf_counter() - began)
            error = max(_errors(robot, frame, answer.q, g))
            if answer.converged and error <= REACHED:
                first, worst = [*first, answer.first], max(worst, error)
        starts = np.percentile(first, [50, 99, 100], method="higher") if first else np.full(3, np.nan)
        shown = (f"{x:.0f}" for x in starts)
        row(name, count, f"{len(first) / count:.1%}", *shown, f"{worst:.1e}", f"{1e3 * np.median(times):.1f}")


def poses_beside_pink(effort: Effort) -> None:
    """The same poses from the middle of the limits alone, by the library and by pin-pink's tasks and limits."""
    if not installed("pink", "quadprog"):
        return
    count = 2 if effort.quick else 50
    table("arm", "poses", "reached from one start", "by pin-pink", "both", "ms a pose", "pin-pink")
    for name, frame in FRAMES.items():
        robot, rng = arm(name), np.random.default_rng(1)
        mine, its, times = [], [], np.zeros((count, 2))
        for k in range(count):
            g = robot.placement(robot.random_configuration(rng), frame)
            began = perf_counter()
            mine.append(rd.control.inverse_kinematics(robot, g, frame=frame, starts=1).converged)
            times[k, 0], began = perf_counter() - began, perf_counter()
            its.append(_by_pink(robot, frame, g))
            times[k, 1] = perf_counter() - began
        shares = (f"{np.mean(each):.0%}" for each in (mine, its, np.logical_and(mine, its)))
        row(name, count, *shares, *(f"{x:.1f}" for x in 1e3 * np.median(times, axis=0)))


def _by_pink(robot: rd.Robot, frame: str, g: np.ndarray) -> bool:
    """Whether pin-pink brings the frame to the pose, from the start that `inverse_kinematics` takes."""
    import pink  # pyright: ignore[reportMissingImports]

    low, high = (np.where(np.isfinite(x), x, 0.0) for x in (robot.lower, robot.upper))
    model, start = robot.model, np.clip((low + high) / 2, robot.lower, robot.upper)
    configuration = pink.Configuration(model, model.createData(), robot.couplings.position(start))
    task = pink.FrameTask(frame, position_cost=1.0, orientation_cost=1.0, lm_damping=1e-6)
    task.set_target(pin.SE3(g))
    for _ in range(PINK_STEPS):
        try:
            v = pink.solve_ik(configuration, [task], dt=PINK_DT, solver="quadprog", safety_break=False)
        except pink.exceptions.PinkError:
            return False
        configuration.integrate_inplace(v, PINK_DT)
        here = configuration.get_transform_frame_to_world(frame)
        if np.linalg.norm(pin.log6(here.actInv(pin.SE3(g))).vector) <= PINK_REACHED:
            return True
    return False


def _errors(robot: rd.Robot, frame: str, q: np.ndarray, g: np.ndarray) -> tuple[float, float]:
    """Distance and angle from a pose, by Pinocchio's logarithm."""
    here = pin.SE3(robot.placement(q, frame))
    left = here.actInv(pin.SE3(g))
    return float(np.linalg.norm(left.translation)), float(np.linalg.norm(pin.log3(left.rotation)))
