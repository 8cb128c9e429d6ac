"""A ladder: runs of one method, from coarse to fine, with the error and the cost of each.

Where steps are small enough, error ∝ h^p, so that log error against log steps is a line of slope −p.
[Hairer, Nørsett, Wanner 1993, II.10]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from math import isfinite
from statistics import median
from typing import final

import numpy as np

from robot_dyn.result import UNREPORTED, reported

COMPILED, INTERPRETED = "compiled", "interpreted"
_RESOLVED = 0.1  # [rad] or [m]: runs with larger errors show no order
_MORE = 1.1  # times the steps: with fewer, stability and not accuracy chose them
_ABOVE = 10.0  # times the error of the reference: nearer to it, an error is partly that of the reference


@final
@dataclass(frozen=True)
class Point:
    """One run.

    Attributes:
        setting: Step, in [s], or relative tolerance.
        steps: Number of steps; None of a program that does not report it.
        evaluations: Evaluations of the equation of motion, those of its Jacobian apart; None as of steps.
        error: Largest |q − q_ref| over joints and records, in [rad] or [m]; inf if the run diverged.
        energy: Largest residual of the energy ledger at the records, as a part of the energy exchanged; nan if it is
            not known.
        time_s: Median time of the loop alone, in [s].
        repeats: Number of times it was timed.
        believed: Whether the error is above that of the reference.
    """

    setting: float
    steps: int | None
    evaluations: int | None
    error: float
    energy: float
    time_s: float
    repeats: int
    believed: bool


@final
@dataclass(frozen=True)
class Price:
    """What an error costs: a time in [s] or a number of evaluations, and whether it is extrapolated."""

    value: float
    extrapolated: bool


@final
@dataclass(frozen=True)
class ToleranceLadder:
    """Runs of one method.

    Attributes:
        method: Its name.
        engine: "compiled" or "interpreted"; "" of another program.
        events: Whether steps end at the thresholds of the effects.
        order: Order that its source states; None if there is none.
        by: What differs from run to run: "step" or "tolerance".
        points: From coarse to fine.
        ended: Why there is none that is finer.
        floor: Error of the reference, in [rad] or [m].
    """

    method: str
    engine: str
    events: bool
    order: int | None
    by: str
    points: tuple[Point, ...] = field(metadata=UNREPORTED)
    ended: str
    floor: float = field(metadata=UNREPORTED)

    @reported
    def name(self) -> str:
        """Of the method, with what sets it apart."""
        return ladder_name(self.method, self.engine, self.events)

    @property
    def peer(self) -> bool:
        """Whether it is another program's."""
        return not self.engine

    @reported
    def measured_order(self) -> float | None:
        """Median slope of log error against log steps between neighbours; None if too few runs show it.

        Errors within ten times that of the reference do not count, nor do those above 0.1 rad or m.
        """
        shown = [p for p in self.points if p.steps and _ABOVE * self.floor < p.error < _RESOLVED]
        slopes = [
            float(np.log(a.error / b.error) / np.log(b.steps / a.steps))
            for a, b in pairwise(shown)
            if a.steps and b.steps and b.steps >= _MORE * a.steps
        ]
        return median(slopes) if len(slopes) > 1 else None

    def price(self, error: float, of: str = "time_s") -> Price | None:
        """What an error costs, in `time_s` or `evaluations`; None if nothing can be said.

        Between two runs it is interpolated in the logarithms; an error that a finer run exceeds again does not count
        as reached. Beyond the finest run it follows from the order, the measured one if that is lower.
        """
        known = [p for p in self.points if isfinite(p.error) and getattr(p, of)]
        if error < self.floor or not known:
            return None
        errors = np.maximum([p.error for p in known], self.floor)
        errors = np.maximum.accumulate(errors[::-1])[::-1]
        costs = np.array([getattr(p, of) for p in known], dtype=float)
        costs = np.minimum.accumulate(costs[::-1])[::-1]  # a finer run that took less time will do
        reached = np.flatnonzero(errors <= error)
        if len(reached):
            i = int(reached[0])
            if i == 0 or errors[i - 1] == errors[i]:
                return Price(float(costs[i]), False)
            part = np.log(errors[i - 1] / error) / np.log(errors[i - 1] / errors[i])
            return Price(float(costs[i - 1] * (costs[i] / costs[i - 1]) ** part), False)
        orders = [p for p in (self.order, self.measured_order) if p is not None and p > 0]
        if errors[-1] > _RESOLVED or not orders:
            return None
        return Price(float(costs[-1] * (errors[-1] / error) ** (1 / min(orders))), True)


def ladder_name(method: str, engine: str, events: bool) -> str:
    """The name of a method, with what sets its ladder apart."""
    apart = [INTERPRETED] * (engine == INTERPRETED) + ["without events"] * (not events)
    return f"{method} ({', '.join(apart)})" if apart else method
