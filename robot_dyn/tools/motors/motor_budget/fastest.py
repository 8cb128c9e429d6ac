"""The path of a motion at its limits: from stop to stop as fast as they allow; pauses keep their length.

Between two stops the path is taken through places at equal distances along it, and `rd.tools.motors.path` moves along
it. A stop stays one, since the path may have a corner there. What then needs more than the continuous torque is slowed
down as a whole, by the least factor that keeps it. If the given motion fits and this one does not, or is no faster, the
given one is the answer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, final

import numpy as np

from robot_dyn import Plant
from robot_dyn.control import PiecewisePolynomial, Plan
from robot_dyn.foundations import UNREPORTED, Answer, Block, PlanError, reported
from robot_dyn.queries import of_joint
from robot_dyn.tools.motors.limits import Limits
from robot_dyn.tools.motors.motor_budget.budget import budget
from robot_dyn.tools.motors.motor_budget.joint_budget import TOLERANCE
from robot_dyn.tools.motors.motor_budget.pace import Pace, at_pace, least_pace
from robot_dyn.tools.motors.motor_budget.result import MotorBudget, case_of
from robot_dyn.tools.motors.planning.geometric_path import at_rest_exactly, through
from robot_dyn.tools.motors.planning.path_at_limits import path

_RESTS = 1e-3  # of the largest velocity of a joint: slower is a stop
_TIMES, _PLACES = 4000, 80  # of the motion, and of a path between two stops
_STILL = 1e-12  # of the largest velocity, or [rad] or [m] that a joint moves: at rest but for rounding
_SHORT = 1e-6  # of the longest way between two stops: rounding, or what a spline does in a pause


@final
@dataclass(frozen=True, eq=False, repr=False)
class FastestMotion(Answer):
    """The path of a motion at its limits.

    Attributes:
        before: Duration of the motion, in [s].
        strokes: How often it moves from stop to stop.
        distance: How far it is from the path at most, in [rad] or [m].
        slowed: λ, by which the motion at peak torques and speeds is slowed down to keep continuous torques; 1 if it
            keeps them, or no pace does.
        no_pace: Which joint passes its continuous torque at every pace, in words; empty if a pace fits.
        given: Whether it is the given motion, which fits, and no faster one that fits was found.
        share: Of the peak torques that it may take.
        budget: What it asks of the motors.
        plan: The motion.
    """

    before: float
    strokes: int
    distance: float
    slowed: float
    no_pace: str
    given: bool
    share: float
    budget: MotorBudget
    plan: Plan = field(metadata=UNREPORTED)

    @reported
    def duration(self) -> float:
        """In [s]."""
        return self.plan.duration

    def blocks(self) -> Iterator[Block]:
        _, *rest = self.plan.blocks()
        share = "" if self.share == 1 else f" at {100 * self.share:.6g} % of the peak torques"
        if self.given:
            yield f"no faster motion along the path that fits was found{share}; the given one fits, and is the answer:"
        else:
            stops = "without a stop" if self.strokes == 1 else f"in {self.strokes} strokes, with the same pauses"
            times = f"{self.duration:.4g} s in place of {self.before:.4g} s"
            yield f"the same path in {times}{share}, {stops}, at most {self.distance:.1g} rad or m beside it:"
        yield from rest
        if self.slowed > 1:
            yield f"slowed down by {self.slowed:.4g} from peak torques and speeds, to keep continuous torque"
        if self.no_pace:
            yield self.no_pace
        yield self.budget.verdict


def fastest(motor_budget: MotorBudget, share: float = 1.0) -> FastestMotion:
    """Plan the path of a motion as fast as the limits of its budget allow, from stop to stop; pauses keep their length.

    It keeps the path and gives up the timing, which a uniform factor would keep: then the slowest place would
    decide for all. Only what needs more than continuous torques at that pace is slowed down as a whole,
    pauses as well, by the least factor that keeps them, if one does. If the given motion fits and this one does
    not, or is no faster, the given one is returned.

    Args:
        motor_budget: The budget of a plan.
        share: Of the peak torques that it may take, up to 1.

    Raises:
        QueryError: If the budget is of a run.
        PlanError: If an effect depends on time, or no motion is within the limits.
        MissingExtraError: Without toppra.
    """
    plant, motion, limits = case_of(motor_budget, "the fastest motion")
    plan, strokes, distance = _planned(plant, at_rest_exactly(motion), limits, share)
    bounds = {"effort": limits.effort, "velocity": limits.velocity, "continuous": limits.continuous}
    before, pace = motion.end - motion.start, least_pace(plan.reference, plant, limits.continuous)
    if pace.fits and pace.factor > 1:
        method = f"{plan.method}, slowed down by {pace.factor:.4g}"
        plan = replace(plan, reference=at_pace(plan.reference, pace.factor), method=method)
    of_it = replace(budget(plan, plant, **bounds), limits=motor_budget.limits)
    if _fits(motor_budget, share) and (not of_it.fits or plan.duration >= before):
        given = replace(plan, reference=motion, method="the given motion", findings=motor_budget.findings)
        return FastestMotion(before, strokes, 0.0, 1.0, "", True, share, motor_budget, given)
    slowed, no_pace = (pace.factor, "") if pace.fits else (1.0, _no_pace(pace, of_it))
    return FastestMotion(before, strokes, distance, slowed, no_pace, False, share, of_it, plan)


def _fits(found: MotorBudget, share: float) -> bool:
    """Whether a motion is within all limits, and within a share of the peak torques."""
    return found.fits and all(each.shares["peak"] <= share * (1 + TOLERANCE) for each in found.joints)


def _no_pace(pace: Pace, found: MotorBudget) -> str:
    """What is passed at the best pace, in words."""
    joint = found.joints[pace.joint]
    limit = joint.continuous_limit
    return (
        f"no pace fits: {joint.joint} needs {pace.share * limit:.4g} of {limit:.4g} {of_joint('N m', joint.type)} rms"
        f" at the best, {pace.factor:.4g} times as slow"
    )


def _planned(plant: Plant, motion: PiecewisePolynomial, limits: Limits, share: float) -> tuple[Plan, int, float]:
    """The plan, how many strokes it has, and how far it is from the path."""
    strokes = _strokes(motion)
    if not strokes:
        raise PlanError("the motion rests from its start to its end: there is no path to be faster on")
    q, since, off = motion.at(np.array([motion.start]))[0][0], motion.start, 0.0
    parts, findings = list[PiecewisePolynomial | None](), dict[str, None]()
    bounds = {"effort": limits.effort, "velocity": limits.velocity, "acceleration": limits.acceleration}
    for start, end in strokes:
        way, places = _way(motion, start, end)
        points = np.array([np.interp(np.linspace(0, way[-1], _PLACES), way, column) for column in places.T]).T
        still = np.ptp(places, axis=0) <= _STILL
        points[:, still] = q[still]
        points[0] = q  # where the last stroke ended
        made = path(plant, points, share=share, **bounds)
        parts += [_pause(q, start - since), made.reference]
        off, since, q = max(off, _distance(points, way, places)), end, points[-1]
        findings |= dict.fromkeys(made.findings)
    parts.append(_pause(q, motion.end - since))
    robot: Any = plant.dynamics
    by_kind = {"velocity": limits.velocity, "torque": limits.effort * share}
    kinds, how = (robot.name, robot.joint_names, robot.joint_types), "the same path at its limits"
    return Plan(*kinds, _joined(parts), how, by_kind, tuple(findings)), len(strokes), off


def _strokes(motion: PiecewisePolynomial) -> list[tuple[float, float]]:
    """From stop to stop: start and end of each, in [s]."""
    t = np.unique(np.concatenate([motion.breaks, np.linspace(motion.start, motion.end, _TIMES)]))
    v = motion.at(t)[1]
    largest = np.abs(v).max(axis=0)
    v = v / np.where(largest > 0, largest, 1.0)
    speed = np.abs(v).max(axis=1)
    stops = [_rest(speed, *each) for each in _runs(speed <= _RESTS)]
    turns = np.flatnonzero((np.sum(v[1:] * v[:-1], axis=1) < 0) & (speed[1:] > _RESTS) & (speed[:-1] > _RESTS))
    stops = sorted([*stops, *((int(k), int(k)) for k in turns), (0, 0), (len(t) - 1, len(t) - 1)])
    strokes = [(float(t[end]), float(t[start])) for (_, end), (start, _) in pairwise(stops) if start > end]
    ways = [float(_way(motion, *each)[0][-1]) for each in strokes]
    return [each for each, way in zip(strokes, ways, strict=True) if way > _SHORT * max(ways)]


def _runs(where: np.ndarray) -> list[tuple[int, int]]:
    """First and last index of each run of what is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], where.astype(int), [0]])))
    return [(int(start), int(end) - 1) for start, end in edges.reshape(-1, 2)]


def _rest(speed: np.ndarray, start: int, end: int) -> tuple[int, int]:
    """The part of a slow time that is at rest, if any is."""
    still = start + np.flatnonzero(speed[start : end + 1] <= _STILL)
    return (int(still[0]), int(still[-1])) if len(still) else (start, end)


def _way(motion: PiecewisePolynomial, start: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """The length of the path up to places on it, (k,), and the places, (k, n)."""
    places = motion.at(np.linspace(start, end, _TIMES))[0]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    moved = np.concatenate([[True], np.diff(way) > 0])
    return way[moved], places[moved]


def _distance(points: np.ndarray, way: np.ndarray, places: np.ndarray) -> float:
    """How far the spline through points is beside the path at most, in [rad] or [m]."""
    spline = through(points)
    q, slope, _ = spline.at(way / way[-1] * spline.end)
    along = slope / np.linalg.norm(slope, axis=1, keepdims=True)
    off = q - places
    return float(np.abs(off - np.sum(off * along, axis=1, keepdims=True) * along).max())


def _pause(q: np.ndarray, duration: float) -> PiecewisePolynomial | None:
    return PiecewisePolynomial([0.0, duration], q[None, None]) if duration > 0 else None


def _joined(parts: list[PiecewisePolynomial | None]) -> PiecewisePolynomial:
    """One after the other, from time 0."""
    there = [each for each in parts if each is not None]
    degree = max(each.coefficients.shape[1] for each in there)
    tables = [np.pad(x.coefficients, ((0, 0), (0, degree - x.coefficients.shape[1]), (0, 0))) for x in there]
    steps = np.concatenate([np.diff(each.breaks) for each in there])
    return PiecewisePolynomial(np.concatenate([[0.0], np.cumsum(steps)]), np.concatenate(tables))
