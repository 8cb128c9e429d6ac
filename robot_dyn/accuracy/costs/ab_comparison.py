"""Comparison of two versions of a computation, or of a part on and off: instructions counted, times in turns.

ratio = first / second, of the least times; what separates them is judged in each turn, in which the speed of the
machine is that of both
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, final

import numpy as np

from robot_dyn.foundations.result import UNREPORTED, reported
from robot_dyn.report import timing
from robot_dyn.report.result import INTERRUPTED
from robot_dyn.report.time_budget import Budget
from robot_dyn.report.timing import Repeated, Timed


@final
@dataclass(frozen=True)
class Version(Repeated):
    """One of two; its times are those of the processor.

    Attributes:
        name: What sets it apart, such as "on".
        instructions: Of its program, exact.
        run: Runs it and returns the time it takes, in [s]; versions with the same function share its times.
    """

    name: str
    instructions: int
    run: Callable[[], float] | None = field(default=None, compare=False, repr=False, metadata=UNREPORTED)


@final
@dataclass(frozen=True)
class ABComparison:
    """Two versions beside each other.

    Attributes:
        group: What it is about: "parts", "algorithms" or "machine code".
        what: What differs.
        per: What instructions and time are of.
        first, second: The two.
    """

    group: str
    what: str
    per: str
    first: Version
    second: Version

    @property
    def added(self) -> int:
        """Instructions of the first less those of the second."""
        return self.first.instructions - self.second.instructions

    @reported
    def instructions_ratio(self) -> float:
        """Instructions of the first by those of the second; inf if that has none."""
        return self.first.instructions / self.second.instructions if self.second.instructions else float("inf")

    @reported
    def time_ratio(self) -> float | None:
        """Time of the first by that of the second; None if one was not timed."""
        first, second = self._turns
        return float(first.min() / second.min()) if len(first) else None

    @reported
    def time_ratio_spread(self) -> float | None:
        """Half of the interquartile range of the ratios in each turn; None if one was not timed."""
        first, second = self._turns
        return float(np.subtract(*np.percentile(first / second, (75, 25)))) / 2 if len(first) else None

    @reported
    def time_between_s(self) -> float | None:
        """Time of the first less that of the second, in [s]; None if the middle half of the turns disagrees."""
        first, second = self._turns
        if not len(first):
            return None
        low, high = np.percentile(first - second, (25, 75))
        between = float(first.min() - second.min())
        return between if low * between > 0 < high * between else None

    @property
    def within_noise(self) -> bool:
        """Whether both were timed, and the turns do not agree on which takes longer."""
        return self.time_ratio is not None and self.time_between_s is None

    @property
    def _turns(self) -> np.ndarray:
        """Times of both in the turns that both had, (2, k)."""
        turns = min(len(self.first.times), len(self.second.times))
        return np.array([self.first.times[:turns], self.second.times[:turns]])


def take_turns(
    pairs: Sequence[ABComparison], budget: Budget, repeats: int
) -> tuple[tuple[ABComparison, ...], list[str]]:
    """Time all versions at most `repeats` times, one after the other; return them, and which were not timed and why."""
    runs, left_out = dict[Any, Timed](), list[str]()
    for pair in pairs:
        for version in (pair.first, pair.second):
            if version.run is not None:
                runs.setdefault(version.run, Timed(f"{pair.what}, {version.name}", version.run))
    try:
        failed: dict[str, Any] = dict(timing.take_turns(runs.values(), repeats, budget))
        if budget.left <= 0:
            late = f"the budget of {budget.seconds:g} s ended"
            failed = {timed.name: late for timed in runs.values() if not timed.times} | failed
        left_out = [f"time of {name}: {why}" for name, why in failed.items()]
    except KeyboardInterrupt:
        left_out = [INTERRUPTED]

    def timed(version: Version) -> Version:
        return replace(version, run=None, times=tuple(runs[version.run].times))

    return tuple(replace(pair, first=timed(pair.first), second=timed(pair.second)) for pair in pairs), left_out
