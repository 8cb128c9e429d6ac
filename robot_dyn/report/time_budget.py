"""The time that a measurement may take, without the time for compiling."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from time import perf_counter
from typing import final


class OvertimeError(Exception):
    """Internal error: a run exceeds its time."""


@final
class Budget:
    """A time budget.

    Args:
        seconds: The time, in [s].
        on_progress: Function of the elapsed time, in [s], and the name of the current run.
        clock: Function that returns the time, in [s].
    """

    def __init__(
        self, seconds: float = inf, on_progress: Callable[[float, str], object] | None = None,
        clock: Callable[[], float] = perf_counter,
    ) -> None:  # fmt: skip
        self.seconds, self._on_progress, self._clock = seconds, on_progress, clock
        self._began, self._apart = clock(), 0.0

    @property
    def spent(self) -> float:
        """Elapsed time without excluded parts, in [s]."""
        return self._clock() - self._began - self._apart

    @property
    def left(self) -> float:
        """Remaining time, in [s]; negative if the budget is exceeded."""
        return self.seconds - self.spent

    def report(self, name: str) -> None:
        """Report the name of the current run."""
        if self._on_progress is not None:
            self._on_progress(min(self.spent, self.seconds), name)

    @contextmanager
    def apart(self) -> Iterator[None]:
        """Exclude the time spent inside from the budget."""
        began = self._clock()
        try:
            yield
        finally:
            self._apart += self._clock() - began

    def within(self, seconds: float) -> Budget:
        """Return a budget of the remaining time, at most `seconds`."""
        return Budget(min(seconds, self.left), clock=self._clock)

    def check(self, t: float = 0.0) -> None:
        """Raise an OvertimeError if no time remains; can be passed to a run as `on_progress`."""
        if self.left <= 0:
            raise OvertimeError
