"""The fastest motion along a path within limits, by the full dynamics of the plant."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np

from robot_dyn import Plant
from robot_dyn.control import PiecewisePolynomial, Plan, hold
from robot_dyn.foundations import JointValues, PlanError, number
from robot_dyn.tools.motors.limits import Limits, check_motors, limits_of
from robot_dyn.tools.motors.motors_file import Motors
from robot_dyn.tools.motors.planning.geometric_path import geometric_path, in_time, turning_points
from robot_dyn.tools.motors.planning.path_plan import (
    BINDS,
    LimitUse,
    PathPlan,
    bindings,
    checked_times,
    elsewhere,
    limit_use,
    phases,
)
from robot_dyn.tools.motors.planning.plannable import check_effects, check_limited, check_positions, why_not
from robot_dyn.tools.motors.planning.time_scaling import IMPOSED, Effects, Speed, cells, fastest, imposed

_CELLS, _MOST_CELLS = 200, 8000  # number of cells of the grid, in addition to breaks of the path
_ROUNDS = 40
_PATIENCE = 3  # number of rounds in which the error of lines must fall to half
_TIGHTER = 3  # number of attempts with tighter limits if the motion exceeds them
_ERROR = 1e-4  # largest error of linearised torque, as a share of its limit
_REST = 1e-20  # relative to the largest ṡ²: speed at which effects at rest are linearised, so that friction has a sign
_SAME = 1e-9  # relative to the path: reversals nearer to each other, or to a break, are one
_SHORTEST = 1e-5  # relative to the duration: shorter pieces are not halved
_ABOVE, _REFUSED = 1.0005, 1.001  # shares of a limit that lead to refinement and to an error
_AT_LIMITS, _ENOUGH = 0.985, 0.98  # target share of time at a limit, and the share below which there is a finding
_INSIDE = np.array([0.02, 0.25, 0.5, 0.75, 0.98])  # places in cells that are checked for refinement
_EXPECTED = 1.0, 0.2, 5.0, 0.04, 25.0  # factors on the expected duration: toppra's solver needs its scale


def path(
    plant: Any,
    points: JointValues | PiecewisePolynomial,
    *,
    fraction: float = 1.0,
    effort: Any = None,
    velocity: Any = None,
    acceleration: Any = None,
    motors: Motors | None = None,
) -> PathPlan:
    """Plan the fastest motion along a path, from rest to rest, within limits of torque, velocity and acceleration.

        minimise T over s(t):  |τ(q, q̇, q̈)| ≤ fraction · τ_max,  |q̇| ≤ v_max,  |q̈| ≤ a_max  on q = q(s(t))

    τ is the plant's inverse dynamics, with all effects. The motion is a polynomial in each of a few hundred pieces, in
    which s̈ is constant: acceleration and torque jump between pieces, as in all time-optimal motions. The limits are
    checked at 10 000 times and at both ends of each piece. A controller that follows the motion needs torque for
    feedback: pass fraction=0.95. With gears of efficiency η, the limit is η τ_max, also for braking; the torque of the
    motors is checked.

    Args:
        plant: A plant or an arm.
        points: Way points, (m, n), in [rad] or [m], joined by a natural cubic spline; also a list of points by joint
            name, 0 for joints left out; or a `rd.control.PiecewisePolynomial`, whose timing is ignored.
        fraction: Fraction of the effort limits that the motion may use, up to 1.
        effort: Effort limits, one number, by joint name or (n,), in [N m] or [N]; by default the limits of the motors
            or, without motors, of the robot's file.
        velocity: Velocity limits, one number, by joint name or (n,), in [rad/s] or [m/s]; same default.
        acceleration: Acceleration limits, one number, by joint name or (n,), in [rad/s²] or [m/s²]; none by default.
        motors: Motors of `rd.tools.motors.read_motors`, with peak torques and speeds.

    Raises:
        PlanError: If points or limits are invalid, the path leaves the joint limits, an effect depends on time or has
            states, or no motion is within the limits; the message names the joint or the effect.
        MissingExtraError: If toppra is not installed.

    Source: Bobrow, Dubowsky, Gibson, Time-Optimal Control of Robotic Manipulators Along Specified Paths, 1985; Pham,
    Pham, A New Approach to Time-Optimal Path Parameterization Based on Reachability Analysis, 2018.
    """
    plant = plant if isinstance(plant, Plant) else Plant(plant)
    check_motors(motors)
    return planned(plant, limits_of(plant, motors, effort, velocity, acceleration), points, fraction)


def planned(plant: Plant, limits: Limits, points: JointValues | PiecewisePolynomial, fraction: float) -> PathPlan:
    """Plan the fastest motion along a path within limits, with torques up to a fraction of theirs."""
    fraction = number("fraction", fraction, error=PlanError, above=0.0)
    if fraction > 1:
        raise PlanError(f"fraction must be at most 1, got {fraction:g}")
    limits = limits.times(fraction)
    geometry = geometric_path(points, plant.dynamics.joint_names)
    check_effects(plant)
    check_positions(plant, geometry)
    check_limited(plant, limits.through_gear(), geometry)
    names = plant.dynamics.joint_names
    motion, use, largest = _within(plant, limits, geometry)
    at_limits = float((use.largest >= BINDS).mean())
    moves = np.any(geometry.coefficients[:, 1:], axis=(0, 1))
    free = [name for i, name in enumerate(names) if moves[i] and np.isinf(limits.effort[i])]
    unlimited = (f"joint {name!r} moves without an effort limit; give effort={{{name!r}: …}}" for name in free)
    findings = [*limits.findings, *unlimited]
    if at_limits < _ENOUGH:
        findings.append(f"no limit binds for {1 - at_limits:.1%} of the time: a faster motion may exist")
    robot: Any = plant.dynamics
    kinds = getattr(robot, "joint_types", ("revolute",) * robot.n)
    by_kind = {"velocity": limits.velocity, "acceleration": limits.acceleration, "torque": limits.effort}
    method = "path at its limits" + ("" if fraction == 1 else f", with torques up to {fraction:.4g} of theirs")
    return PathPlan(
        Plan(getattr(robot, "name", "arm"), names, kinds, motion, method, by_kind, tuple(findings)),
        fraction,
        largest,
        at_limits,
        elsewhere(use, motion.breaks),
        tuple(bindings(use, limits, names)),
        tuple(phases(use, names)),
        {name: use.shares[0][:, i] for i, name in enumerate(names) if np.isfinite(limits.effort[i])},
    )


def _within(plant: Plant, limits: Limits, path: PiecewisePolynomial) -> tuple[PiecewisePolynomial, LimitUse, float]:
    """Return the fastest motion within limits, its use of the limits, and the largest used fraction."""
    allowed, largest, error = 1.0, inf, inf
    for _ in range(_TIGHTER):
        motion, error = _fastest_motion(plant, limits.through_gear().times(allowed, allowed), path)
        use = limit_use(plant, limits, motion, checked_times(motion.end_s))
        ends = (motion.breaks[:-1, None] + np.diff(motion.breaks)[:, None] * IMPOSED).ravel()
        largest = float(max(use.largest.max(), limit_use(plant, limits, motion, ends).largest.max()))
        if largest <= _REFUSED and (error <= _ERROR or limits.line is not None):
            # where a line is steep, its linearisation is off, but the motion is within limits
            return motion, use, largest
        allowed /= max(1.0, largest)
    remedy = "smoother effects" if limits.line is None else "lines of torque over speed without steep parts"
    raise PlanError(
        f"no motion was found within the limits: the best one uses {largest:.5f} of them, and the linearised"
        f" torque is off by {error:.2g} of the limits; use a smoother path or {remedy}"
    )


def _fastest_motion(plant: Plant, limits: Limits, path: PiecewisePolynomial) -> tuple[PiecewisePolynomial, float]:
    """Return the motion, and the error of its linearised effects as a share of the effort limits."""
    fixed = _apart(path.breaks, turning_points(path)) if _varies(plant, limits) else path.breaks
    cosine = (1 - np.cos(np.linspace(0, np.pi, _CELLS + 1))) / 2
    grid = _merged(fixed, path.breaks[0] + (path.breaks[-1] - path.breaks[0]) * cosine)
    duration = cells(plant, limits, path, grid, None).expected_duration
    last = Speed(path.breaks[[0, -1]], np.full(2, ((path.breaks[-1] - path.breaks[0]) / duration) ** 2))
    motion, error, errors = hold(path.at(path.breaks[0])[0]), inf, []
    for turn in range(_ROUNDS):
        last, error = _solved(plant, limits, path, grid, last, duration)
        motion = in_time(path, last.s, last.x)
        duration = motion.end_s
        if turn == 0:  # change to pieces of about the same duration
            grid = _merged(fixed, _places(last, motion.breaks, np.linspace(0, duration, _CELLS + 1)))
            continue
        bad, settled = _unsettled(plant, limits, motion)
        if (error < _ERROR and (settled or not bad.any())) or len(grid) > _MOST_CELLS:
            break
        errors.append(error)
        falls = min(errors[-_PATIENCE:]) < min(errors[:-_PATIENCE], default=inf) / 2
        if limits.line is not None and min(errors) > _ERROR and not falls:
            break  # the speed alternates between two sides of a corner
        grid = np.sort(np.concatenate([grid, (grid[:-1] + grid[1:])[bad] / 2]))
    return motion, error


def _solved(
    plant: Plant, limits: Limits, path: PiecewisePolynomial, grid: np.ndarray, last: Speed, duration: float
) -> tuple[Speed, float]:
    """Return the fastest speed on a grid, and the error of linearised effects as a share of the effort limits.

    Effects are linearised about the last speed, or about slower ones if there is no solution.
    """
    places, varies = imposed(grid).ravel(), _varies(plant, limits)
    squares = np.maximum(np.interp(places, *last), _REST * last.x.max())
    for slower in 4.0 ** np.arange(6 if varies else 1):
        effects = Effects.about(plant, limits, path, places, squares / slower) if varies else None
        limits_in_cells = cells(plant, limits, path, grid, effects)
        for factor in _EXPECTED:
            if (x := fastest(limits_in_cells, factor * duration)) is not None:
                speed = Speed(grid, x)
                if effects is None:
                    return speed, 0.0
                return speed, effects.error(plant, limits, path, np.interp(places, *speed))
    raise PlanError(why_not(plant, limits, path))


def _varies(plant: Plant, limits: Limits) -> bool:
    """Return True if the torque of effects, or of the motors, may depend on the speed."""
    return bool(plant.forces) or limits.line is not None


def _unsettled(plant: Plant, limits: Limits, motion: PiecewisePolynomial) -> tuple[np.ndarray, bool]:
    """Return the pieces to halve, (k,), and True if enough of the motion is at a limit and none of it above."""
    h = np.diff(motion.breaks)
    most = limit_use(plant, limits, motion, (motion.breaks[:-1, None] + h[:, None] * _INSIDE).ravel()).largest
    most = most.reshape(len(h), -1)
    at_limits = (h[:, None] * (most >= BINDS)).mean(axis=-1).sum() / h.sum()
    above = most.max(axis=-1) > _ABOVE
    bad = (above | (most.min(axis=-1) < BINDS)) & (h > _SHORTEST * motion.end_s)
    return bad, bool(at_limits >= _AT_LIMITS and not above.any())


def _apart(breaks: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the breaks, and the points that differ from them and from each other by more than rounding."""
    least = _SAME * (breaks[-1] - breaks[0])
    points = points[np.diff(points, prepend=-inf) > least]
    near = np.abs(points[:, None] - breaks).min(axis=-1, initial=inf)
    return np.union1d(breaks, points[near > least])


def _merged(fixed: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return a grid of all fixed points, and the free points that are not close to them."""
    near = np.abs(free[:, None] - fixed).min(axis=-1)
    cell = np.gradient(free)
    return np.unique(np.concatenate([fixed, free[near > 0.3 * cell]]))


def _places(speed: Speed, breaks: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return s at times t."""
    piece = np.clip(np.searchsorted(breaks, t, side="right") - 1, 0, len(breaks) - 2)
    u = (np.diff(speed.x) / (2 * np.diff(speed.s)))[piece]
    h = t - breaks[piece]
    return speed.s[piece] + np.sqrt(speed.x[piece]) * h + u / 2 * h**2
