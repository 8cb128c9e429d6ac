"""The time that a measurement may take; compiling, which happens once, is not part of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from time import perf_counter
from typing import final


class OvertimeError(Exception):
    """Internal: a run that takes longer than it may."""


@final
class Budget:
    """Time to spend.

    Args:
        seconds: In [s].
        on_progress: Called with the time spent, in [s], and with what is being run.
        clock: Gives the time, in [s].
    """

    def __init__(
        self, seconds: float = inf, on_progress: Callable[[float, str], object] | None = None,
        clock: Callable[[], float] = perf_counter,
    ) -> None:  # fmt: skip
        self.seconds, self._on_progress, self._clock = seconds, on_progress, clock
        self._began, self._apart = clock(), 0.0

    @property
    def spent(self) -> float:
        """In [s]."""
        return self._clock() - self._began - self._apart

    @property
    def left(self) -> float:
        """In [s]; negative when it is over."""
        return self.seconds - self.spent

    def report(self, what: str) -> None:
        """Report what is being run."""
        if self._on_progress is not None:
            self._on_progress(min(self.spent, self.seconds), what)

    @contextmanager
    def apart(self) -> Iterator[None]:
        """Exclude the time spent inside from the budget."""
        began = self._clock()
        try:
            yield
        finally:
            self._apart += self._clock() - began

    def within(self, seconds: float) -> Budget:
        """Return a budget of what is left, and of no more than so many seconds."""
        return Budget(min(seconds, self.left), clock=self._clock)

    def check(self, t: float = 0.0) -> None:
        """Raise OvertimeError if it is over; can be passed to a run as its `on_progress`."""
        if self.left <= 0:
            raise OvertimeError
