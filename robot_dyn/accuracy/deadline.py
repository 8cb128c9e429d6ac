"""A time by which work is to end, asked by those who do it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from time import perf_counter
from typing import final

from robot_dyn.accuracy.budget import OvertimeError


@final
@dataclass(frozen=True)
class Deadline:
    """A time by which work is to end.

    Attributes:
        at: On the clock, in [s].
        clock: Gives the time, in [s].
    """

    at: float = inf
    clock: Callable[[], float] = perf_counter

    @property
    def left(self) -> float:
        """In [s]; negative when it has passed."""
        return self.at - self.clock()

    @property
    def passed(self) -> bool:
        """Whether it has passed."""
        return self.left <= 0

    def within(self, seconds: float) -> Deadline:
        """The earlier of it and so many seconds from now."""
        return Deadline(min(self.at, self.clock() + seconds), self.clock)

    def check(self, t: float = 0.0) -> None:
        """Go on, or OvertimeError if it has passed; to be given to a run as its `on_progress`."""
        if self.passed:
            raise OvertimeError


NEVER = Deadline()
