"""Comparison of two versions of a computation, or of a part on and off: instructions counted, times in turns.

ratio = first / second, of the shortest times. The spread is computed from the ratios within a turn, because both
versions of a turn run at the same machine speed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import final

import numpy as np

from robot_dyn.foundations.result import UNREPORTED, reported
from robot_dyn.report import timing
from robot_dyn.report.result import INTERRUPTED
from robot_dyn.report.time_budget import Budget
from robot_dyn.report.timing import Repeated, Timed


@final
@dataclass(frozen=True)
class Version(Repeated):
    """One of two versions; its times are processor times.

    Attributes:
        name: Name that distinguishes it, such as "on".
        instructions: Exact number of instructions of its program.
        run: Function that runs it and returns the time, in [s]; versions with the same function share its times.
    """

    name: str
    instructions: int
    run: Callable[[], float] | None = field(default=None, compare=False, repr=False, metadata=UNREPORTED)


@final
@dataclass(frozen=True)
class ABComparison:
    """Two versions of a computation.

    Attributes:
        group: Kind of comparison: "parts", "algorithms" or "machine code".
        name: Name of the difference between the versions.
        per: Unit of work that instructions and times refer to.
        first, second: The two versions.
    """

    group: str
    name: str
    per: str
    first: Version
    second: Version

    @property
    def added(self) -> int:
        """Instructions of the first minus those of the second."""
        return self.first.instructions - self.second.instructions

    @reported
    def instructions_ratio(self) -> float:
        """Instructions of the first divided by those of the second; inf if the second has none."""
        return self.first.instructions / self.second.instructions if self.second.instructions else float("inf")

    @reported
    def time_ratio(self) -> float | None:
        """Time of the first divided by that of the second; None if one was not timed."""
        first, second = self._turns
        return float(first.min() / second.min()) if len(first) else None

    @reported
    def time_ratio_spread(self) -> float | None:
        """Half the interquartile range of the time ratios within a turn; None if one was not timed."""
        first, second = self._turns
        return float(np.subtract(*np.percentile(first / second, (75, 25)))) / 2 if len(first) else None

    @reported
    def time_between_s(self) -> float | None:
        """Time of the first minus that of the second, in [s]; None if the middle half of the turns disagrees."""
        first, second = self._turns
        if not len(first):
            return None
        low, high = np.percentile(first - second, (25, 75))
        difference = float(first.min() - second.min())
        return difference if low * difference > 0 < high * difference else None

    @property
    def within_noise(self) -> bool:
        """True if both were timed, and the turns disagree about which takes longer."""
        return self.time_ratio is not None and self.time_between_s is None

    @property
    def _turns(self) -> np.ndarray:
        """Times of both versions in the turns that both had, (2, k)."""
        turns = min(len(self.first.times), len(self.second.times))
        return np.array([self.first.times[:turns], self.second.times[:turns]])


def take_turns(
    pairs: Sequence[ABComparison], budget: Budget, repeats: int
) -> tuple[tuple[ABComparison, ...], list[str]]:
    """Time all versions in turns, up to `repeats` times; return the pairs, and notes on versions without a time."""
    runs, left_out = dict[Callable[[], float] | None, Timed](), list[str]()
    for pair in pairs:
        for version in (pair.first, pair.second):
            if version.run is not None:
                runs.setdefault(version.run, Timed(f"{pair.name}, {version.name}", version.run))
    try:
        failed: dict[str, object] = dict(timing.take_turns(runs.values(), repeats, budget))
        if budget.left <= 0:
            reason = f"the budget of {budget.seconds:g} s ended"
            failed = {timed.name: reason for timed in runs.values() if not timed.times} | failed
        left_out = [f"time of {name}: {reason}" for name, reason in failed.items()]
    except KeyboardInterrupt:
        left_out = [INTERRUPTED]

    def timed(version: Version) -> Version:
        return replace(version, run=None, times=tuple(runs[version.run].times))

    return tuple(replace(pair, first=timed(pair.first), second=timed(pair.second)) for pair in pairs), left_out
