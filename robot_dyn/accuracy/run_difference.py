"""Difference of two runs of one robot: by joint, with the time at which they diverge and the settings that differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import inf, nan
from typing import ClassVar, final

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
        joint: Name of the joint.
        quantity: "q", "v" or "u", the actuation.
        unit: Unit of `rms` and `largest`.
        rms: Root mean square over the common time; nan if one run did not record the quantity.
        largest: Largest absolute value.
        at_s: Time of the largest value, in [s].
    """

    joint: str
    quantity: str
    unit: str
    rms: float
    largest: float
    at_s: float


@final
@dataclass(frozen=True, eq=False, repr=False)
class RunDifference(Result):
    """The difference b − a of two runs.

    Attributes:
        robot: Name of the robot.
        names: Names of the two runs.
        joints: Rms and largest difference of q, v and u by joint.
        start_s, end_s: Limits of the time that both runs cover, in [s].
        samples: Number of times at which the runs are compared.
        common: Number of these times at which both runs have a sample; at the others one run is interpolated in q.
        fraction: Fraction of the time from start_s to end_s that was compared.
        interpolation: Allowance for interpolation errors, in the unit of q; 0 without interpolation.
        parted_s: First time at which q differs by more than the errors of the runs, in [s]; None if it never does.
        judged_until_s: Time up to which the errors of both runs are known, in [s].
        bound: The threshold beyond which the runs part, in words.
        settings: The settings that differ.
        left_out: Notes on omitted comparisons.
        environment: Software versions of the first run.
        runs: The two runs.
        difference: The difference at all times of comparison.
    """

    diagram: ClassVar[str] = "robot_dyn.accuracy.run_difference_figure"
    columns: ClassVar[tuple[str, ...]] = ("joint", "quantity", "unit", "rms", "largest", "at_s")
    robot: str
    names: tuple[str, str]
    joints: tuple[JointDifference, ...]
    start_s: float
    end_s: float
    samples: int
    common: int
    fraction: float
    interpolation: float
    parted_s: float | None
    judged_until_s: float
    bound: str
    settings: tuple[DifferingSetting, ...]
    left_out: tuple[str, ...]
    environment: dict[str, str]
    runs: tuple[TrajectoryData, TrajectoryData] = field(metadata=UNREPORTED)
    difference: Difference = field(metadata=UNREPORTED)

    @property
    def sentence(self) -> str:
        """One sentence about whether and when the runs part."""
        a, b = self.names
        if self.parted_s is not None:
            return f"{a} and {b} part at t = {self.parted_s:.4g} s: q differs by more than {self.bound}"
        if not self.is_conclusive:
            return f"{a} and {b} were compared over only {self.fraction:.0%} of the time; record both at the same times"
        end = (
            ""
            if self.judged_until_s >= self.end_s
            else f" up to t = {self.judged_until_s:.4g} s, where an estimate ends"
        )
        if not any(joint.largest > 0 for joint in self.joints):
            return f"{a} and {b} are equal at all {self.samples} times"
        return f"{a} and {b} do not part{end}: q never differs by more than {self.bound}"

    @reported
    def is_conclusive(self) -> bool:
        """True if half of the time or more was compared; otherwise no run is reported equal."""
        return self.fraction >= HALF

    @property
    def rows(self) -> Iterator[Mapping[str, object]]:
        """A row for each quantity of each joint."""
        return (vars(joint) for joint in self.joints)

    def tables(self) -> Iterator[Block]:
        between = self.samples - self.common
        where = f"{self.common} common samples; q between samples at {between}" if between else "common samples"
        yield (
            f"b − a, {self.start_s:g} to {self.end_s:g} s, at {self.samples} times ({where}),"
            f" {self.fraction:.0%} of the time:"
        )
        rows = tuple((row.joint, f"{row.quantity} [{row.unit}]", row.rms, row.largest, row.at_s) for row in self.joints)
        yield Table(("joint", "quantity", "rms", "largest", "at t [s]"), rows, digits=3)
        yield ""
        if self.settings:
            yield f"settings that differ (a: {self.names[0]}; b: {self.names[1]}):"
            rows = tuple((setting.name, setting.a, setting.b) for setting in self.settings)
            yield Table(("setting", "a", "b"), rows, wrap=True)
        else:
            yield "all settings are equal"
        yield ""


def diff_runs(a: TrajectoryData, b: TrajectoryData, *, tolerance: float = TOLERANCE) -> RunDifference:
    """Compare two runs of one robot over the time that both cover: differences by joint, and differing settings.

    The runs are compared at common samples. In stretches without common samples, q is also compared at the samples of
    either run, if quintic interpolation of (q, v, a) is accurate enough and no event is near. The runs part where q of
    a joint differs by more than twice the sum of their estimated errors, or by more than the tolerance if a run has no
    estimate. If less than half of the time can be compared, record both runs at the same times. Root mean squares are
    over time: √(1/T ∫ (x_b − x_a)² dt).

    Args:
        a: A run.
        b: Another run of the same robot.
        tolerance: Threshold in [rad] or [m] for runs without an error estimate.

    Raises:
        QueryError: If the runs are of different robots, or have no time in common.
    """
    for name, run in (("a", a), ("b", b)):
        instance(name, run, TrajectoryData, "give a trajectory of rd.simulate or rd.read, or a run of rollouts")
    tolerance = number("tolerance", tolerance, above=0, error=QueryError)
    differences, types = difference(a, b, tolerance), joint_types(a)
    unit_of_q, (first, second) = joint_units("q", types), run_names(a, b)
    left_out = [f"{t:g} to {s:g} s, covered by {name} only" for name, t, s in _unshared(a, b)]
    if not differences.estimated:
        left_out.append("errors of the runs, because one has no estimate; simulate with estimate_error=True")
    bound = "twice their estimated errors" if differences.estimated else f"{tolerance:g} {unit_of_q}"
    if differences.interpolation > 0:
        bound += f" and {differences.interpolation:.1g} {unit_of_q} of interpolation"
    return RunDifference(
        robot=a.metadata.get("robot", ""),
        names=(first, second),
        joints=tuple(_joint_differences(differences, types)),
        start_s=differences.start_s,
        end_s=differences.end_s,
        samples=len(differences.t),
        common=int(differences.is_common.sum()),
        fraction=differences.fraction,
        interpolation=differences.interpolation,
        parted_s=differences.parted_s,
        judged_until_s=differences.judged_until_s,
        bound=bound,
        settings=differing_settings(a, b),
        left_out=(*left_out, *unknown_settings(a, b)),
        environment=_versions(a),
        runs=(a, b),
        difference=differences,
    )


def _joint_differences(differences: Difference, types: tuple[str | None, ...]) -> Iterator[JointDifference]:
    for i, (name, kind) in enumerate(zip(differences.joint_names, types, strict=True)):
        for quantity in ("q", "v", "u"):
            at = slice(None) if quantity == "q" else differences.is_common
            t, x = differences.t[at], getattr(differences, quantity)[at, i]
            yield JointDifference(name, quantity, unit(quantity, kind), _rms(t, x), *_largest(t, x))


def _rms(t: np.ndarray, x: np.ndarray) -> float:
    """Return the root mean square over time by the trapezoidal rule; nan if x has no samples."""
    if not len(t):
        return nan
    if len(t) == 1:
        return float(abs(x[0]))
    size = float(np.abs(x).max())
    if not 0 < size < inf:
        return size
    return size * float(np.sqrt(np.trapezoid((x / size) ** 2, t) / (t[-1] - t[0])))  # no square overflows


def _largest(t: np.ndarray, x: np.ndarray) -> tuple[float, float]:
    """Return the largest |x| and its time; nan for both if x has no values."""
    if np.isnan(x).all():
        return nan, nan
    k = int(np.nanargmax(np.abs(x)))
    return float(abs(x[k])), float(t[k])


def _unshared(a: TrajectoryData, b: TrajectoryData) -> Iterator[tuple[str, float, float]]:
    """Return name, start and end of each interval that only one run covers."""
    for name, run, other in zip(run_names(a, b), (a, b), (b, a), strict=True):
        if run.t[0] < other.t[0]:
            yield name, float(run.t[0]), float(other.t[0])
        if run.t[-1] > other.t[-1]:
            yield name, float(other.t[-1]), float(run.t[-1])


def _versions(run: TrajectoryData) -> dict[str, str]:
    pairs = (part.partition(" ") for part in run.metadata.get("versions", "").split(", ") if part)
    return {name: version for name, _, version in pairs}
