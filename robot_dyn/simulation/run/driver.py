"""A run that Python follows: its loop comes back for progress, for Ctrl-C, for the observer, and for what it doubts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from time import perf_counter
from typing import ClassVar

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.simulation.dynamics.loop_state import Ended, Now
from robot_dyn.simulation.observation.observer import Observer

_PAUSE_S = 0.1  # between looks at the keyboard


class Driver(ABC):
    """A run on its way.

    Attributes:
        on_progress: Called with the time reached, at each step or some ten times a second, or None.
        observer: Sees each step, or None.
        compiled: Whether its loop is machine code.
        now: Where it is; see `time_loop.Now`.
        stop: Its first entry ends the run at its next step where it is not 0, as Ctrl-C does.
        first: Steps of machine code before its speed is known.
    """

    on_progress: Callable[[float], object] | None
    observer: Observer | None
    compiled: bool
    now: Array
    stop: Array
    first: ClassVar[int]

    @property
    @abstractmethod
    def time(self) -> float:
        """The time reached, in [s]."""

    @abstractmethod
    def _advance(self) -> Ended:
        """The loop, until it comes back."""

    @abstractmethod
    def _judge(self, ended: Ended) -> None:
        """What the loop came back for; DivergedError ends the run."""

    def _room(self, budget: int) -> int:
        """So many steps, or fewer, for which there is room."""
        return budget if self.observer is None else min(budget, self.observer.room)

    def _loop(self) -> None:
        budget, told = self.first if self.compiled else 1, -1.0
        while True:
            if self.on_progress is not None and self.time > told:
                told = self.time
                self.on_progress(told)
            began = perf_counter()
            ended = self._go(budget)
            if ended is Ended.DONE:
                break
            if self.stop[0]:
                raise KeyboardInterrupt
            self._judge(ended)
            if ended is Ended.PAUSED and self.compiled:
                spent = perf_counter() - began
                budget = int(np.clip(budget * _PAUSE_S / max(spent, 1e-9), self.first // 10, 100 * budget))
        if self.on_progress is not None and self.time > told:
            self.on_progress(self.time)

    def _go(self, budget: int) -> Ended:
        """So many steps, with a rest whenever there is no room for what is shown and kept."""
        observer = self.observer
        while True:
            self.now[Now.BUDGET] = steps = self._room(budget)
            if observer is not None:
                self.now[Now.COLUMN] = observer.filled
            ended = self._advance()
            if observer is not None:
                observer.filled = int(self.now[Now.COLUMN])
                observer.look()
            budget -= steps
            if ended is not Ended.PAUSED or budget <= 0:
                return ended
