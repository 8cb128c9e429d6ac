"""The fastest motion along a given path, from stop to stop within the limits; pauses keep their length.

Between two stops, `rd.tools.motors.path` plans a motion along a spline through equidistant places on the path. Stops
are kept, because the path may have a corner there. If the result exceeds a continuous torque limit, it is slowed down
as a whole by the smallest sufficient factor. If the original motion fits and the new one does not, or is slower, the
original one is returned.
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
from robot_dyn.tools.motors.motor_budget.budget import of_plan
from robot_dyn.tools.motors.motor_budget.joint_budget import TOLERANCE
from robot_dyn.tools.motors.motor_budget.pace import Pace, at_pace, least_pace
from robot_dyn.tools.motors.motor_budget.result import MotorBudget, case_of
from robot_dyn.tools.motors.planning.geometric_path import at_rest_exactly, through
from robot_dyn.tools.motors.planning.path_at_limits import planned

_RESTS = 1e-3  # relative to the largest velocity of a joint: anything slower is a stop
_TIMES, _PLACES = 4000, 80  # number of sample times of a motion, and of points on the path between two stops
_STILL = 1e-12  # relative velocity, or [rad] or [m] of motion, that counts as rest
_SHORT = 1e-6  # relative to the longest stroke: a shorter one is rounding, or an artefact of a spline in a pause


@final
@dataclass(frozen=True, eq=False, repr=False)
class FastestMotion(Answer):
    """The fastest motion along the path of another motion, the original.

    Attributes:
        before_s: Duration of the original motion, in [s].
        strokes: Number of movements from stop to stop.
        distance: Largest distance from the original path, in [rad] or [m].
        slowed: Factor λ on the duration that meets the continuous torque limits; 1 if not needed, or if no λ suffices.
        no_pace: Message about the joint that exceeds its continuous torque limit at every pace; empty if a pace fits.
        is_original: True if this is the original motion: it fits, and no faster one that fits was found.
        fraction: Fraction of the peak torques that the motion may use.
        budget: Motor budget of the motion.
        plan: The motion.
    """

    before_s: float
    strokes: int
    distance: float
    slowed: float
    no_pace: str
    is_original: bool
    fraction: float
    budget: MotorBudget
    plan: Plan = field(metadata=UNREPORTED)

    @reported
    def duration_s(self) -> float:
        """Duration of the motion, in [s]."""
        return self.plan.duration_s

    @property
    def cycle_times(self) -> str:
        """Durations of the original motion and of this one, in words."""
        return f"cycle times: {self.before_s:.4g} s as given, {self.duration_s:.4g} s at the limits"

    def blocks(self) -> Iterator[Block]:
        _, *rest = self.plan.blocks()
        limit = "" if self.fraction == 1 else f" at {100 * self.fraction:.6g} % of the peak torques"
        if self.is_original:
            yield f"found no faster motion along the path that fits{limit}; the original motion, which fits:"
        else:
            stops = "without a stop" if self.strokes == 1 else f"in {self.strokes} strokes, with the same pauses"
            times = f"{self.duration_s:.4g} s instead of {self.before_s:.4g} s"
            yield f"the same path in {times}{limit}, {stops}, within {self.distance:.1g} rad or m of it:"
        yield from rest
        if self.slowed > 1:
            yield f"slowed down by a factor of {self.slowed:.4g} to meet the continuous torque limits"
        if self.no_pace:
            yield self.no_pace
        yield self.budget.verdict


def fastest(motor_budget: MotorBudget, fraction: float = 1.0) -> FastestMotion:
    """Plan the fastest motion along the path of a motion, from stop to stop within the limits of its budget.

    The path and the lengths of pauses are kept, the timing is not: with a uniform factor, the slowest place would limit
    the whole motion. If the result exceeds a continuous torque limit, it is slowed down as a whole, with its pauses, by
    the smallest sufficient factor, if there is one. If the original motion fits and the new one does not, or is slower,
    the original one is returned.

    Args:
        motor_budget: The budget of a plan.
        fraction: Fraction of the peak torques that the motion may use, up to 1.

    Raises:
        QueryError: If the budget is of a run.
        PlanError: If an effect depends on time, or no motion within the limits is found.
        MissingExtraError: If toppra is not installed.
    """
    plant, motion, limits = case_of(motor_budget, "the fastest motion")
    plan, strokes, distance = _planned(plant, at_rest_exactly(motion), limits, fraction)
    before, pace = motion.end_s - motion.start_s, least_pace(plan.reference, plant, limits)
    if pace.fits and pace.factor > 1:
        method = f"{plan.method}, slowed down by {pace.factor:.4g}"
        plan = replace(plan, reference=at_pace(plan.reference, pace.factor), method=method)
    new_budget = of_plan(plan, plant, limits, motor_budget.limits)
    result = {"before_s": before, "strokes": strokes, "fraction": fraction}
    if _fits(motor_budget, fraction) and (not new_budget.fits or plan.duration_s >= before):
        plan = replace(plan, reference=motion, method="the original motion", findings=motor_budget.findings)
        return FastestMotion(
            **result, distance=0.0, slowed=1.0, no_pace="", is_original=True, budget=motor_budget, plan=plan
        )
    slowed, no_pace = (pace.factor, "") if pace.fits else (1.0, _no_pace(pace, new_budget))
    return FastestMotion(
        **result, distance=distance, slowed=slowed, no_pace=no_pace, is_original=False, budget=new_budget, plan=plan
    )


def _fits(motor_budget: MotorBudget, fraction: float) -> bool:
    """Return True if a motion is within all limits, and within a fraction of the peak torques."""
    return motor_budget.fits and all(x.shares["peak"] <= fraction * (1 + TOLERANCE) for x in motor_budget.joints)


def _no_pace(pace: Pace, motor_budget: MotorBudget) -> str:
    """Return a message about the limit that is exceeded even at the best pace."""
    joint = motor_budget.joints[pace.joint]
    unit = of_joint("N m", joint.type)
    return (
        f"no pace fits: {joint.joint} needs {pace.fraction * pace.limit:.4g} of {pace.limit:.4g} {unit} rms at the"
        f" best pace, with {pace.factor:.4g} times the duration"
    )


def _planned(plant: Plant, motion: PiecewisePolynomial, limits: Limits, fraction: float) -> tuple[Plan, int, float]:
    """Return the plan, its number of strokes, and its largest distance from the path."""
    strokes = _strokes(motion)
    if not strokes:
        raise PlanError("the motion is at rest throughout, so it has no path; give a motion that moves")
    q, since, off = motion.at(np.array([motion.start_s]))[0][0], motion.start_s, 0.0
    parts, findings = list[PiecewisePolynomial | None](), dict[str, None]()
    for start, end in strokes:
        way, places = _way(motion, start, end)
        points = np.array([np.interp(np.linspace(0, way[-1], _PLACES), way, column) for column in places.T]).T
        still = np.ptp(places, axis=0) <= _STILL
        points[:, still] = q[still]
        points[0] = q  # end of the previous stroke
        stroke = planned(plant, limits, points, fraction)
        parts += [_pause(q, start - since), stroke.reference]
        off, since, q = max(off, _distance(points, way, places)), end, points[-1]
        findings |= dict.fromkeys(stroke.findings)
    parts.append(_pause(q, motion.end_s - since))
    robot: Any = plant.dynamics
    by_kind = {"velocity": limits.velocity, "torque": limits.effort * fraction}
    kinds, how = (robot.name, robot.joint_names, robot.joint_types), "the same path at its limits"
    return Plan(*kinds, _joined(parts), how, by_kind, tuple(findings)), len(strokes), off


def _strokes(motion: PiecewisePolynomial) -> list[tuple[float, float]]:
    """Return start and end of each movement from stop to stop, in [s]."""
    t = np.unique(np.concatenate([motion.breaks, np.linspace(motion.start_s, motion.end_s, _TIMES)]))
    v = motion.at(t)[1]
    largest = np.abs(v).max(axis=0)
    v = v / np.where(largest > 0, largest, 1.0)
    speed = np.abs(v).max(axis=1)
    stops = [_rest(speed, start, end) for start, end in _runs(speed <= _RESTS)]
    turns = np.flatnonzero((np.sum(v[1:] * v[:-1], axis=1) < 0) & (speed[1:] > _RESTS) & (speed[:-1] > _RESTS))
    stops = sorted([*stops, *((int(k), int(k)) for k in turns), (0, 0), (len(t) - 1, len(t) - 1)])
    strokes = [(float(t[end]), float(t[start])) for (_, end), (start, _) in pairwise(stops) if start > end]
    ways = [float(_way(motion, *stroke)[0][-1]) for stroke in strokes]
    return [stroke for stroke, way in zip(strokes, ways, strict=True) if way > _SHORT * max(ways)]


def _runs(where: np.ndarray) -> list[tuple[int, int]]:
    """Return the first and last index of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], where.astype(int), [0]])))
    return [(int(start), int(end) - 1) for start, end in edges.reshape(-1, 2)]


def _rest(speed: np.ndarray, start: int, end: int) -> tuple[int, int]:
    """Return the part of a slow interval that is at rest, or all of it if it never rests."""
    still = start + np.flatnonzero(speed[start : end + 1] <= _STILL)
    return (int(still[0]), int(still[-1])) if len(still) else (start, end)


def _way(motion: PiecewisePolynomial, start: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the length of the path up to places on it, (k,), and the places, (k, n)."""
    places = motion.at(np.linspace(start, end, _TIMES))[0]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    moved = np.concatenate([[True], np.diff(way) > 0])
    return way[moved], places[moved]


def _distance(points: np.ndarray, way: np.ndarray, places: np.ndarray) -> float:
    """Return the largest distance of the spline through points from the path, in [rad] or [m]."""
    spline = through(points)
    q, slope, _ = spline.at(way / way[-1] * spline.end_s)
    along = slope / np.linalg.norm(slope, axis=1, keepdims=True)
    off = q - places
    return float(np.abs(off - np.sum(off * along, axis=1, keepdims=True) * along).max())


def _pause(q: np.ndarray, duration: float) -> PiecewisePolynomial | None:
    return PiecewisePolynomial([0.0, duration], q[None, None]) if duration > 0 else None


def _joined(parts: list[PiecewisePolynomial | None]) -> PiecewisePolynomial:
    """Return the parts in sequence, from time 0."""
    motions = [part for part in parts if part is not None]
    degree = max(motion.coefficients.shape[1] for motion in motions)
    tables = [np.pad(x.coefficients, ((0, 0), (0, degree - x.coefficients.shape[1]), (0, 0))) for x in motions]
    steps = np.concatenate([np.diff(motion.breaks) for motion in motions])
    return PiecewisePolynomial(np.concatenate([[0.0], np.cumsum(steps)]), np.concatenate(tables))
