"""Two runs of one robot compared: by joint, when they part, and in what their settings differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import inf, nan
from typing import Any, ClassVar, final

import numpy as np

from robot_dyn.foundations.answer import Block, Table
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.result import UNREPORTED, reported
from robot_dyn.foundations.validate import instance, number
from robot_dyn.queries.units import joint_units, unit
from robot_dyn.report.result import Result
from robot_dyn.simulation.comparison.difference import HALF, TOLERANCE, Difference, difference
from robot_dyn.simulation.comparison.differing_settings import (
    DifferingSetting,
    differing_settings,
    run_names,
    unknown_settings,
)
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.simulation.results.run_data import TrajectoryData


@final
@dataclass(frozen=True)
class JointDifference:
    """The difference b − a of a quantity of a joint.

    Attributes:
        joint: Its name.
        quantity: "q", "v" or "u", the actuation.
        unit: Of the numbers.
        rms: Root mean square over the common time; nan if one run did not record it.
        largest: Largest absolute value.
        at: When, in [s].
    """

    joint: str
    quantity: str
    unit: str
    rms: float
    largest: float
    at: float


@final
@dataclass(frozen=True, eq=False, repr=False)
class RunDifference(Result):
    """What differs between two runs, b − a.

    Attributes:
        robot: Its name.
        names: Of the two runs.
        joints: Rms and largest difference of q, v and u by joint.
        start, end: The time that both runs have, in [s].
        samples: Number of times at which they are compared.
        common: Number of these at which both have a sample; at the others q of one of them is interpolated.
        fraction: Fraction of the time from start to end that was compared.
        interpolation: Largest error of interpolation that is allowed for, in the unit of q; 0 if there is none.
        parted: When q first differs by more than their errors, in [s]; None if it never does.
        judged_until: Time until which that is known, in [s].
        bound: What they part beyond, in words.
        settings: The settings that differ.
        left_out: What is not compared.
        environment: Versions that the first run was made with.
    """

    diagram: ClassVar[str] = "robot_dyn.accuracy.run_difference_figure"
    columns: ClassVar[tuple[str, ...]] = ("joint", "quantity", "unit", "rms", "largest", "at")
    robot: str
    names: tuple[str, str]
    joints: tuple[JointDifference, ...]
    start: float
    end: float
    samples: int
    common: int
    fraction: float
    interpolation: float
    parted: float | None
    judged_until: float
    bound: str
    settings: tuple[DifferingSetting, ...]
    left_out: tuple[str, ...]
    environment: dict[str, str]
    runs: tuple[TrajectoryData, TrajectoryData] = field(metadata=UNREPORTED)
    difference: Difference = field(metadata=UNREPORTED)

    @property
    def sentence(self) -> str:
        """When the runs part, in a sentence."""
        a, b = self.names
        if self.parted is not None:
            return f"{a} and {b} part at t = {self.parted:.4g} s: q differs by more than {self.bound}"
        if not self.is_conclusive:
            return f"{a} and {b} were compared over {self.fraction:.0%} of the time only: record both at the same times"
        end = (
            "" if self.judged_until >= self.end else f" up to t = {self.judged_until:.4g} s, until which both are known"
        )
        if not any(each.largest > 0 for each in self.joints):
            return f"{a} and {b} are equal at all {self.samples} times"
        return f"{a} and {b} do not part{end}: q never differs by more than {self.bound}"

    @reported
    def is_conclusive(self) -> bool:
        """Return True if half of the time or more was compared; otherwise no run is reported equal."""
        return self.fraction >= HALF

    @property
    def rows(self) -> Iterator[Mapping[str, Any]]:
        """A row for each quantity of each joint."""
        return (vars(each) for each in self.joints)

    def tables(self) -> Iterator[Block]:
        between = self.samples - self.common
        where = f"{self.common} common samples; q between samples at {between}" if between else "common samples"
        yield (
            f"b − a, {self.start:g} to {self.end:g} s, at {self.samples} times ({where}),"
            f" {self.fraction:.0%} of the time:"
        )
        rows = tuple(
            (each.joint, f"{each.quantity} [{each.unit}]", each.rms, each.largest, each.at) for each in self.joints
        )
        yield Table(("joint", "quantity", "rms", "largest", "at t [s]"), rows, digits=3)
        yield ""
        if self.settings:
            yield f"settings that differ (a: {self.names[0]}; b: {self.names[1]}):"
            yield Table(("setting", "a", "b"), tuple((each.name, each.a, each.b) for each in self.settings), wrap=True)
        else:
            yield "no setting differs"
        yield ""


def diff_runs(a: TrajectoryData, b: TrajectoryData, *, tolerance: float = TOLERANCE) -> RunDifference:
    """Compare two runs of one robot on the time that both have: by joint, when they part, what differs in settings.

    They are compared at common samples; in stretches without any, q is compared at the samples of either run as well,
    where quintics of (q, v, a) are known to be exact enough and no event is near. They part where q of a joint differs
    by more than twice the sum of the estimated errors of both; where a run has no estimate, by more than the tolerance.
    If less than half of the time can be compared, record both at the same times. Root mean squares are over time:
    √(1/T ∫ (x_b − x_a)² dt).

    Args:
        a: A run.
        b: Another one of the same robot.
        tolerance: In [rad] or [m], for runs without an estimate of their error.

    Raises:
        QueryError: If they are of different robots, or have no time in common.
    """
    for name, run in (("a", a), ("b", b)):
        instance(name, run, TrajectoryData, "give the trajectory of rd.simulate or rd.read, or a run of rollouts")
    tolerance = number("tolerance", tolerance, above=0, error=QueryError)
    found, types = difference(a, b, tolerance), joint_types(a)
    of_q, (first, second) = joint_units("q", types), run_names(a, b)
    left = [f"{t:g} to {s:g} s, which only {name} has" for name, t, s in _alone(a, b)]
    if not found.estimated:
        left.append("the errors of the runs, since one has no estimate; simulate with estimate_error=True")
    beyond = "twice their estimated errors" if found.estimated else f"{tolerance:g} {of_q}"
    interpolation = f" and {found.interpolation:.1g} {of_q} of interpolation" if found.interpolation > 0 else ""
    return RunDifference(
        robot=a.about.get("robot", ""),
        names=(first, second),
        joints=tuple(_of_joints(found, types)),
        start=found.start,
        end=found.end,
        samples=len(found.t),
        common=int(found.is_common.sum()),
        fraction=found.fraction,
        interpolation=found.interpolation,
        parted=found.parted,
        judged_until=found.judged_until,
        bound=beyond + interpolation,
        settings=differing_settings(a, b),
        left_out=(*left, *unknown_settings(a, b)),
        environment=_versions(a),
        runs=(a, b),
        difference=found,
    )


def _of_joints(found: Difference, types: tuple[str | None, ...]) -> Iterator[JointDifference]:
    for i, (name, kind) in enumerate(zip(found.joint_names, types, strict=True)):
        for quantity in ("q", "v", "u"):
            at = slice(None) if quantity == "q" else found.is_common
            t, x = found.t[at], getattr(found, quantity)[at, i]
            yield JointDifference(name, quantity, unit(quantity, kind), _rms(t, x), *_largest(t, x))


def _rms(t: np.ndarray, x: np.ndarray) -> float:
    """Over time, by the trapezoidal rule; nan where x is not known."""
    if not len(t):
        return nan
    if len(t) == 1:
        return float(abs(x[0]))
    size = float(np.abs(x).max())
    if not 0 < size < inf:
        return size
    return size * float(np.sqrt(np.trapezoid((x / size) ** 2, t) / (t[-1] - t[0])))  # no square overflows


def _largest(t: np.ndarray, x: np.ndarray) -> tuple[float, float]:
    if np.isnan(x).all():
        return nan, nan
    k = int(np.nanargmax(np.abs(x)))
    return float(abs(x[k])), float(t[k])


def _alone(a: TrajectoryData, b: TrajectoryData) -> Iterator[tuple[str, float, float]]:
    """Times that one run has and the other has not, by name."""
    for name, run, other in zip(run_names(a, b), (a, b), (b, a), strict=True):
        if run.t[0] < other.t[0]:
            yield name, float(run.t[0]), float(other.t[0])
        if run.t[-1] > other.t[-1]:
            yield name, float(other.t[-1]), float(run.t[-1])


def _versions(run: TrajectoryData) -> dict[str, str]:
    pairs = (each.partition(" ") for each in run.about.get("versions", "").split(", ") if each)
    return {name: version for name, _, version in pairs}
