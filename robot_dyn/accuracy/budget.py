"""The time that a measurement may take; compiling, which happens once, is not part of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
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
    """

    def __init__(self, seconds: float, on_progress: Callable[[float, str], object] | None = None) -> None:
        self.seconds, self._on_progress = seconds, on_progress
        self._began, self._apart = perf_counter(), 0.0

    @property
    def spent(self) -> float:
        """In [s]."""
        return perf_counter() - self._began - self._apart

    @property
    def left(self) -> float:
        """In [s]; negative when it is over."""
        return self.seconds - self.spent

    def tell(self, what: str) -> None:
        """Say what is being run."""
        if self._on_progress is not None:
            self._on_progress(min(self.spent, self.seconds), what)

    @contextmanager
    def apart(self) -> Iterator[None]:
        """What is done inside does not count."""
        began = perf_counter()
        try:
            yield
        finally:
            self._apart += perf_counter() - began


@final
class Limit:
    """The longest time of one run: given to it as `on_progress`, it raises OvertimeError.

    The clock starts when the loop comes back first: before that, machine code may be loaded.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds, self._calls, self._until = seconds, 0, 0.0

    def __call__(self, t: float) -> None:
        self._calls += 1
        if self._calls == 2:
            self._until = perf_counter() + self.seconds
        elif self._calls > 2 and perf_counter() > self._until:
            raise OvertimeError
