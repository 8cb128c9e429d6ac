"""Two ways to one result, or a part on and off: their instructions counted, their times medians of turns.

ratio = first / second
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import final

import numpy as np

from robot_dyn.accuracy.budget import Budget
from robot_dyn.errors import RobotDynError


@final
@dataclass(frozen=True)
class Version:
    """One of two.

    Attributes:
        name: What sets it apart, such as "on".
        instructions: Of its program, exact.
        time_s: Median of its times, in [s]; None if it was not timed.
        spread_s: Half of the interquartile range of its times, in [s]; likewise.
        repeats: Number of times it was timed.
    """

    name: str
    instructions: int
    time_s: float | None
    spread_s: float | None
    repeats: int


@final
@dataclass(frozen=True)
class Alternative:
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
    def instructions_ratio(self) -> float:
        """Instructions of the first by those of the second; inf if that has none."""
        return self.first.instructions / self.second.instructions if self.second.instructions else float("inf")

    @property
    def time_ratio(self) -> float | None:
        """Likewise of times; None if one was not timed."""
        if self.first.time_s is None or self.second.time_s is None:
            return None
        return self.first.time_s / self.second.time_s

    @property
    def time_between_s(self) -> float | None:
        """Time of the first less that of the second, in [s]; None if it is lost in their spreads, or not timed."""
        times = self.first.time_s, self.second.time_s, self.first.spread_s, self.second.spread_s
        if None in times:
            return None
        first, second, *spreads = (float(x) for x in times if x is not None)
        return first - second if abs(first - second) > sum(spreads) else None


@final
@dataclass(eq=False)
class Way:
    """A version that can be run.

    Attributes:
        name: As of `Version`, as are instructions.
        run: Gives the time it takes, in [s]; RobotDynError if it cannot be run.
        factor: How many of these make what is compared.
    """

    name: str
    instructions: int
    run: Callable[[], float]
    factor: int = 1
    times: list[float] = field(default_factory=list)

    def version(self) -> Version:
        """What was found."""
        if not self.times:
            return Version(self.name, self.factor * self.instructions, None, None, 0)
        low, middle, high = self.factor * np.percentile(self.times, (25, 50, 75))
        spread = float(high - low) / 2
        return Version(self.name, self.factor * self.instructions, float(middle), spread, len(self.times))

    def named(self, name: str, factor: int = 1) -> Way:
        """The same under another name, and so many of it; its times are shared."""
        return Way(name, self.instructions, self.run, factor, self.times)


@final
@dataclass(frozen=True, eq=False)
class Pair:
    """Two ways, to be measured; attributes as of `Alternative`."""

    group: str
    what: str
    per: str
    first: Way
    second: Way

    def alternative(self) -> Alternative:
        """What was found."""
        return Alternative(self.group, self.what, self.per, self.first.version(), self.second.version())


def in_turns(pairs: Iterable[Pair], budget: Budget, repeats: int) -> list[str]:
    """Time all ways so often at most, one after the other, and say which were not.

    What the first run of each compiles or loads is apart from the budget.
    """
    ways: dict[int, tuple[str, Way]] = {}  # by what they share
    for pair in pairs:
        for way in (pair.first, pair.second):
            ways.setdefault(id(way.times), (f"{pair.what}, {way.name}", way))
    left_out: list[str] = []
    for k in range(repeats):
        for key, (name, way) in list(ways.items()):
            if budget.left <= 0:
                untimed = [name for name, way in ways.values() if not way.times]
                return left_out + [f"time of {each}: the budget of {budget.seconds:g} s ended" for each in untimed]
            budget.tell(f"round {k + 1}: {name}")
            try:
                if not k:
                    with budget.apart():
                        way.run()
                way.times.append(way.run())
            except RobotDynError as error:
                left_out.append(f"time of {name}: {error}")
                del ways[key]
    return left_out
