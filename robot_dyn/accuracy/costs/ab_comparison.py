"""Comparison of two versions of a computation, or of a part on and off: instructions counted, times in turns.

ratio = first / second, of the least times; what separates them is judged in each turn, in which the speed of the
machine is that of both
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import final

import numpy as np

from robot_dyn.foundations.result import reported
from robot_dyn.report import timing
from robot_dyn.report.time_budget import Budget
from robot_dyn.report.timing import Timed, repeatable

_QUARTILES = (25, 75)


@final
@dataclass(frozen=True)
class Version:
    """One of two.

    Attributes:
        name: What sets it apart, such as "on".
        instructions: Of its program, exact.
        time_s: Least of its times of the processor, in [s]; None if it was not timed.
        repeats: Number of turns.
        repeatable: Whether there were at least five, the two least times of which differ by no more than 5 %.
    """

    name: str
    instructions: int
    time_s: float | None
    repeats: int
    repeatable: bool


@final
@dataclass(frozen=True)
class ABComparison:
    """Two versions beside each other.

    Attributes:
        group: What it is about: "parts", "algorithms" or "machine code".
        what: What differs.
        per: What instructions and time are of.
        first, second: The two.
        time_ratio: Time of the first by that of the second; None if one was not timed.
        time_ratio_spread: Half of the interquartile range of the ratios in each turn; likewise.
        time_between_s: Time of the first less that of the second, in [s]; None if the middle half of the turns do not
            agree with its sign.
    """

    group: str
    what: str
    per: str
    first: Version
    second: Version
    time_ratio: float | None = None
    time_ratio_spread: float | None = None
    time_between_s: float | None = None

    @property
    def within_noise(self) -> bool:
        """Whether both were timed, and the turns do not agree on which takes longer."""
        return self.time_ratio is not None and self.time_between_s is None

    @reported
    def instructions_ratio(self) -> float:
        """Instructions of the first by those of the second; inf if that has none."""
        return self.first.instructions / self.second.instructions if self.second.instructions else float("inf")


@final
@dataclass(frozen=True, eq=False)
class Way:
    """A version that can be run.

    Attributes:
        name: As of `Version`, as are instructions.
        run: Gives the time it takes, in [s]; RobotDynError if it cannot be run.
        factor: How many of these make what is compared.
        times: Of the turns, in [s]; ways that differ in name and factor alone share them.
    """

    name: str
    instructions: int
    run: Callable[[], float]
    factor: int = 1
    times: list[float] = field(default_factory=list)

    @property
    def version(self) -> Version:
        """What was found."""
        least = self.factor * min(self.times) if self.times else None
        return Version(self.name, self.factor * self.instructions, least, len(self.times), repeatable(self.times))

    def named(self, name: str, factor: int = 1) -> Way:
        """The same under another name, and so many of it."""
        return replace(self, name=name, factor=factor)


@final
@dataclass(frozen=True, eq=False)
class Pair:
    """Two ways, to be measured; attributes as of `ABComparison`."""

    group: str
    what: str
    per: str
    first: Way
    second: Way

    def alternative(self) -> ABComparison:
        """What was found."""
        found = ABComparison(self.group, self.what, self.per, self.first.version, self.second.version)
        turns = min(len(self.first.times), len(self.second.times))
        if not turns:
            return found
        first, second = (way.factor * np.array(way.times[:turns]) for way in (self.first, self.second))
        low, high = np.percentile(first - second, _QUARTILES)
        narrow, wide = np.percentile(first / second, _QUARTILES)
        between = float(first.min() - second.min())
        return replace(
            found, time_ratio=float(first.min() / second.min()), time_ratio_spread=float(wide - narrow) / 2,
            time_between_s=between if low * between > 0 < high * between else None,
        )  # fmt: skip


def take_turns(pairs: Iterable[Pair], budget: Budget, repeats: int) -> list[str]:
    """Time all ways so often at most, one after the other, and return which were not timed, with the reason."""
    runs: dict[int, Timed] = {}  # by the times that ways share
    for pair in pairs:
        for way in (pair.first, pair.second):
            runs.setdefault(id(way.times), Timed(f"{pair.what}, {way.name}", way.run, way.times))
    failed = timing.take_turns(runs.values(), repeats, budget)
    ended = f"the budget of {budget.seconds:g} s ended"
    untimed = {each.name: ended for each in runs.values() if not each.times and budget.left <= 0}
    return [f"time of {name}: {why}" for name, why in {**untimed, **failed}.items()]
