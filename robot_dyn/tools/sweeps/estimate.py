"""An estimated number with its interval."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import isinf, isnan
from typing import final

from robot_dyn.foundations import Answer, Block


@final
@dataclass(frozen=True, repr=False)
class Estimate(Answer):
    """A statistic of the runs of a sweep.

    Attributes:
        statistic: Its name, such as "mean".
        estimate: Its value; infinite if it lies among runs that failed.
        low: Lower end of the interval; −∞ if the runs are too few to give one, nan if there is no interval.
        high: Upper end, accordingly.
        level: Probability with which such intervals hold the true value.
        n: Runs.
        failed: Runs without a finite value, or that were counted as failed.
        method: How the interval was computed.
        note: What limits the result; empty if nothing does.
    """

    statistic: str
    estimate: float
    low: float
    high: float
    level: float
    n: int
    failed: int
    method: str
    note: str = ""

    @property
    def sentence(self) -> str:
        """The statistic and its interval in a line."""
        if isnan(self.low):
            return f"{self.statistic}: {text(self.estimate)}, without an interval"
        interval = f"{100 * self.level:g} % interval {text(self.low)} … {text(self.high)}"
        if self.statistic.startswith("probability") and self.estimate == 0:
            return f"{self.statistic}: below {text(self.high)} ({interval}; no events)"
        if self.statistic.startswith("probability") and self.estimate == 1:
            return f"{self.statistic}: above {text(self.low)} ({interval}; events in all runs)"
        return f"{self.statistic}: {text(self.estimate)} ({interval})"

    def blocks(self) -> Iterator[Block]:
        yield self.sentence
        yield f"{self.n} runs, {self.failed} failed; {self.method}"
        if self.note:
            yield f"note: {self.note}"


def text(x: float) -> str:
    """A number in four digits, or ±∞."""
    return ("−∞" if x < 0 else "+∞") if isinf(x) else f"{x:.4g}"
