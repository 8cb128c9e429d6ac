"""The driver of a run: it calls the loop until the run ends.

The loop returns to it for progress, for Ctrl-C, for the observer, and with what only the interpreted equation can do.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from math import inf
from time import perf_counter
from typing import ClassVar

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.values import cached
from robot_dyn.simulation.dynamics.event import Occurrence
from robot_dyn.simulation.dynamics.loop_state import Ended, Now, Rules, rules_of, runs_of
from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.events.payload_events import PayloadEvents
from robot_dyn.simulation.observation.observation import NOTHING
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.run.outcome import GivesUp, Outcome, Reason, Stiff
from robot_dyn.simulation.run.recording import Path, Recording, Records, records_of
from robot_dyn.simulation.run.watch import DivergedError, Watch
from robot_dyn.simulation.setup.segment_table import SegmentTable
from robot_dyn.simulation.setup.setup import Setup

_PAUSE_S = 0.1  # between looks at the keyboard


class Driver(ABC):
    """A run in progress.

    Args:
        watch: Of the setup, and its state equation.
        payloads: What it carries.
        engine: What evaluates its state equation.
        table: The segments of the run.
        on_progress: Called with the time reached, at each step or some ten times a second.
        observer: Sees each step.

    Attributes:
        setup, equation: What is run, with what it carries now.
        functions, table, runs, records, rules: What the loop takes.
        in_python: The same functions as Python calls them.
        now: Where it is; see `loop_state.Now`.
        stop: Its first entry ends the run at its next step where it is not 0, as Ctrl-C does.
        events: What happened.
        first: Steps of machine code before its speed is known.
    """

    first: ClassVar[int]
    records: Records

    def __init__(
        self, watch: Watch, payloads: PayloadEvents, engine: Engine, table: SegmentTable,
        on_progress: Callable[[float], object] | None, observer: Observer | None,
    ) -> None:  # fmt: skip
        self.watch, self.payloads, self.engine, self.table = watch, payloads, engine, table
        self.setup, self.equation = watch.setup, watch.equation
        self.on_progress, self.observer = on_progress, observer
        self.rules = cached(self.setup, _rules)
        n, m = self.rules.n, self.equation.size
        self.start = self.equation.start(self.setup.q0, self.setup.v0)
        self.functions, self.in_python, parameters, _ = engine.evaluated(self.equation, watch)
        run_parameters = np.concatenate([np.full(self.rules.held, np.nan), parameters])[:, None]
        self.runs = runs_of(self.equation, self.start[:, None], run_parameters, m + n + 2)
        self.runs.energy[0], self.runs.scale[0] = watch.energy, watch.scale
        self.events: list[Occurrence] = []
        self.now, self.stop = np.zeros(len(Now), np.int64), np.zeros(1, np.int64)

    def _records(self, samples: int, shared: int, steps: int) -> Records:
        """Room for so many samples, shared states and ends of steps."""
        n, m, observer = self.rules.n, self.equation.size, self.observer
        shown = (np.empty((1 + 3 * n, 0)), NOTHING) if observer is None else (observer.columns, observer.observation)
        made = np.empty((samples, m, 1)), np.empty((samples, m + n + 2, 1))
        return records_of(np.arange(m), *made, np.empty((shared, m)), np.empty((steps, m)), *shown)

    @property
    @abstractmethod
    def time(self) -> float:
        """The time reached, in [s]."""

    @property
    def y(self) -> np.ndarray:
        """The state reached."""
        return self.runs.y[:, 0].copy()

    @property
    def held(self) -> Array | None:
        """The actuation in zero-order hold; None of a controller that acts continuously."""
        return self.runs.run_parameters[: self.rules.held, 0] if self.rules.held else None

    def run(self) -> Recording | GivesUp:
        """Run to the end, however the run ends; or why another run is to replace it."""
        try:
            with np.errstate(all="ignore"):  # what overflows ends the run
                ended = self._loop()
        except DivergedError as end:
            ended = end.outcome
        except KeyboardInterrupt:
            ended = Outcome(Reason.INTERRUPTED, self.time)
        return self._recording(ended) if isinstance(ended, Outcome) else ended

    def record(self) -> Recording:
        """The recording of a run that no other may replace."""
        recording = self.run()
        assert isinstance(recording, Recording)
        return recording

    @abstractmethod
    def _advance(self) -> Ended:
        """Call the loop, until it returns."""

    @abstractmethod
    def _judge(self, ended: Ended) -> Outcome | GivesUp | None:
        """Do what the loop returned for; how the run ends, or None if it goes on. DivergedError ends it, too."""

    @abstractmethod
    def _paths(self) -> tuple[Path, Path, np.ndarray | None]:
        """The states shared with companions, those at the ends of steps, and the ends of all, if chosen."""

    def _room(self, budget: int) -> int:
        """So many steps, or fewer, for which there is room."""
        return budget if self.observer is None else min(budget, self.observer.room)

    def _replaced(self) -> Stiff | None:
        """Why another method is to make the run, if one is."""
        return None

    def _loop(self) -> Outcome | GivesUp:
        """Advance to the end of the run, or until it gives up."""
        most = self.engine.most_steps
        budget, reported = int(min(self.first, most)), -1.0
        while True:
            if self.on_progress is not None and self.time > reported:
                reported = self.time
                self.on_progress(reported)
            began = perf_counter()
            ended = self._go(budget)
            if ended is Ended.DONE:
                break
            if not isinstance(ended, Ended):
                return ended
            if self.stop[0]:
                raise KeyboardInterrupt
            if (outcome := self._judge(ended)) is not None:
                return outcome
            if ended is Ended.PAUSED and budget < most:
                spent = perf_counter() - began
                budget = int(np.clip(budget * _PAUSE_S / max(spent, 1e-9), self.first // 10, 100 * budget))
        if self.on_progress is not None and self.time > reported:
            self.on_progress(self.time)
        return Outcome(Reason.END, self.setup.duration_s)

    def _go(self, budget: int) -> Ended | Stiff:
        """So many steps, with a rest whenever there is no room for what is observed and recorded."""
        observer = self.observer
        while True:
            if (replaced := self._replaced()) is not None:
                return replaced
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

    def _tick(self) -> None:
        """Do a tick by the interpreted equation."""
        s = int(self.now[Now.SEGMENT])
        self.runs.y[:, 0], held = self.watch.tick(float(self.table.starts[s]), self.y)
        self.runs.run_parameters[: self.rules.held, 0] = held
        self.table.ticks[s] = 0

    def _change_payload(self) -> list[Occurrence]:
        """Go on with what is carried from the start of a segment on; what happened."""
        s = int(self.now[Now.SEGMENT])
        self.runs.y[:, 0], happened = self.payloads.over(float(self.table.starts[s]), self.y)
        self.equation = self.watch.equation = self.payloads.equation
        self.functions, self.in_python, self.runs.run_parameters[self.rules.held :, 0], _ = self.engine.evaluated(
            self.equation, self.watch
        )
        self.table.payload_events[s] = 0
        return happened

    def _recording(self, outcome: Outcome) -> Recording:
        records, rows = self.records, int(self.now[Now.ROW])
        if not rows and len(records.t):  # interrupted, or without a tick, before the first sample
            records.t[0], records.y[0, :, 0], records.made[0], rows = 0.0, self.start, np.nan, 1
        shared, step_log, ends = self._paths()
        return Recording(
            outcome, records.t[:rows], records.y[:rows, :, 0], records.made[:rows, :, 0], shared, step_log,
            int(self.now[Now.STEPS]), int(self.now[Now.EVALUATIONS]), float(self.runs.peak[0]),
            tuple(event for event in self.events if event.t <= outcome.t),  # not those of states that overflow
            ends,
        )  # fmt: skip


def _rules(setup: Setup) -> Rules:
    """The rules of the loop of a run by itself, which shares no states."""
    return rules_of(setup.equation, True, inf)
