"""A ladder: runs of one method, from coarse to fine, with the error and the cost of each.

For sufficiently small steps, error ∝ h^p, so log error against log steps is a line of slope −p.
[Hairer, Nørsett, Wanner 1993, II.10]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from math import isfinite
from statistics import median
from typing import final

import numpy as np

from robot_dyn.foundations.result import UNREPORTED, reported
from robot_dyn.queries.units import format_duration
from robot_dyn.report.timing import Repeated

COMPILED, INTERPRETED = "compiled", "interpreted"
_RESOLVED = 0.1  # [rad] or [m]: runs with larger errors show no order
_MORE = 1.1  # ratio of steps: if smaller, stability rather than accuracy chose the steps
_ABOVE = 10.0  # times the reference error: below this, an error is partly that of the reference


@final
@dataclass(frozen=True)
class Point(Repeated):
    """One run; its times are those of the prepared run.

    Attributes:
        setting: Step, in [s], or relative tolerance.
        steps: Number of steps; None if the program does not report it.
        evaluations: Evaluations of the equation of motion, excluding those of its Jacobian; None if not reported.
        error: Largest |q − q_ref| over joints and records, in [rad] or [m]; inf if the run diverged.
        energy: Largest residual of the energy ledger at the records, as a fraction of the energy exchanged; nan if
            unknown.
        believed: Whether the error is above that of the reference.
    """

    setting: float
    steps: int | None
    evaluations: int | None
    error: float
    energy: float
    believed: bool


@final
@dataclass(frozen=True)
class Price:
    """Time to reach an error, in [s], and whether it is extrapolated."""

    value: float
    extrapolated: bool

    def __str__(self) -> str:
        return format_duration(self.value)


@dataclass(frozen=True)
class Method:
    """A method of this library or of another program.

    Attributes:
        method: Name of the method.
        engine: "compiled" or "interpreted"; "" for another program.
        events: Whether steps end at the thresholds of the effects.
        order: Order stated by the source of the method; None if there is none.
        by: What varies from run to run: "step" or "tolerance".
    """

    method: str
    engine: str
    events: bool
    order: int | None
    by: str

    @reported
    def name(self) -> str:
        """Name of the method, with any marks that distinguish its engine and events."""
        apart = [INTERPRETED] * (self.engine == INTERPRETED) + ["without events"] * (not self.events)
        return f"{self.method} ({', '.join(apart)})" if apart else self.method

    @property
    def peer(self) -> bool:
        """Whether the method is from another program."""
        return not self.engine


@final
@dataclass(frozen=True)
class ToleranceLadder(Method):
    """Runs of one method.

    Attributes:
        points: The runs, from coarse to fine.
        ended: Why there is no finer run.
        floor: Error of the reference, in [rad] or [m].
    """

    points: tuple[Point, ...] = field(metadata=UNREPORTED)
    ended: str
    floor: float = field(metadata=UNREPORTED)

    @reported
    def measured_order(self) -> float | None:
        """Median slope of log error against log steps between neighbours; None if too few runs show it.

        Errors below ten times that of the reference, or above 0.1 rad or m, are ignored.
        """
        shown = [p for p in self.points if p.steps and _ABOVE * self.floor < p.error < _RESOLVED]
        slopes = [
            float(np.log(a.error / b.error) / np.log(b.steps / a.steps))
            for a, b in pairwise(shown)
            if a.steps and b.steps and b.steps >= _MORE * a.steps
        ]
        return median(slopes) if len(slopes) > 1 else None

    def price(self, error: float) -> Price | None:
        """Time to reach an error; None if it cannot be estimated.

        Between two runs the time is interpolated logarithmically; an error that a finer run exceeds does not count as
        reached. Beyond the finest run it is extrapolated with the stated or the measured order, whichever is lower.
        """
        known = [p for p in self.points if isfinite(p.error)]
        if error < self.floor or not known:
            return None
        errors = np.maximum([p.error for p in known], self.floor)
        errors = np.maximum.accumulate(errors[::-1])[::-1]
        times = np.array([p.time_s for p in known])
        times = np.minimum.accumulate(times[::-1])[::-1]  # a finer run that took less serves as well
        reached = np.flatnonzero(errors <= error)
        if len(reached):
            i = int(reached[0])
            if i == 0:
                return Price(float(times[i]), False)
            part = np.log(errors[i - 1] / error) / np.log(errors[i - 1] / errors[i])
            return Price(float(times[i - 1] * (times[i] / times[i - 1]) ** part), False)
        orders = [p for p in (self.order, self.measured_order) if p is not None and p > 0]
        if errors[-1] > _RESOLVED or not orders:
            return None
        return Price(float(times[-1] * (errors[-1] / error) ** (1 / min(orders))), True)
