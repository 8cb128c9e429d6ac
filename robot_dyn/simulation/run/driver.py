"""The driver of a run: it calls the loop until the run ends.

The loop returns to it for progress, for Ctrl-C, for the observer, and with what only the interpreted equation can do.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from time import perf_counter
from typing import ClassVar

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.values import cached
from robot_dyn.simulation.dynamics.event import Occurrence
from robot_dyn.simulation.dynamics.loop_state import Ended, LoopConfig, lanes_of, loop_config, start_position
from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.events.payload_events import PayloadEvents
from robot_dyn.simulation.observation.observation import NOTHING
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.run.outcome import Ending, GivesUp, Outcome, Stiff
from robot_dyn.simulation.run.recording import Loop, Path, Recording, Records, records_of
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
        functions, table, lanes, config, position: What the loop takes; see `Loop`.
        loop: All of it with the records, but for the functions.
        in_python: The same functions as Python calls them.
        stop: Its first entry ends the run at its next step where it is not 0, as Ctrl-C does.
        events: What happened.
        first: Steps of machine code before its speed is known.
    """

    first: ClassVar[int]
    loop: Loop

    def __init__(
        self, watch: Watch, payloads: PayloadEvents, engine: Engine, table: SegmentTable,
        on_progress: Callable[[float], object] | None, observer: Observer | None,
    ) -> None:  # fmt: skip
        self.watch, self.payloads, self.engine, self.table = watch, payloads, engine, table
        self.setup, self.equation = watch.setup, watch.equation
        self.on_progress, self.observer = on_progress, observer
        self.config = cached(self.setup, _config)
        n, m = self.config.n, self.equation.size
        self.start = self.equation.start(self.setup.q0, self.setup.v0)
        self.functions, self.in_python, parameters, _ = engine.evaluated(self.equation, watch)
        run_parameters = np.concatenate([np.full(self.config.held, np.nan), parameters])[:, None]
        self.lanes = lanes_of(self.equation, self.start[:, None], run_parameters, m + n + 2, table.parameters[0])
        self.lanes.energy[0], self.lanes.scale[0] = watch.energy, watch.scale
        self.events: list[Occurrence] = []
        self.position, self.stop = start_position(), np.zeros(1, np.int64)

    def _loop_of(self, samples: int, shared: int, steps: int) -> Loop:
        """The data of the loop, with records for so many samples, shared states and ends of steps."""
        n, m, observer = self.config.n, self.equation.size, self.observer
        records = records_of(
            rows=np.arange(m),
            y=np.empty((samples, m, 1)),
            sampled=np.empty((samples, m + n + 2, 1)),
            shared=np.empty((shared, m)),
            step_log=np.empty((steps, m)),
            columns=np.empty((1 + 3 * n, 0)) if observer is None else observer.columns,
            observation=NOTHING if observer is None else observer.observation,
        )
        return Loop(self.table, self.lanes, records, self.config, self.position)

    @property
    def records(self) -> Records:
        """What the loop records."""
        return self.loop.records

    @property
    @abstractmethod
    def time(self) -> float:
        """The time reached, in [s]."""

    @property
    def y(self) -> np.ndarray:
        """The state reached."""
        return self.lanes.y[:, 0].copy()

    @property
    def held(self) -> Array | None:
        """The actuation in zero-order hold; None of a controller that acts continuously."""
        return self.lanes.run_parameters[: self.config.held, 0] if self.config.held else None

    def run(self) -> Recording | GivesUp:
        """Run to the end, however the run ends; or why another run is to replace it."""
        try:
            with np.errstate(all="ignore"):  # what overflows ends the run
                ended = self._run()
        except DivergedError as end:
            ended = Outcome(Ending.DIVERGED, end.t, str(end))
        except KeyboardInterrupt:
            ended = Outcome(Ending.STOPPED, self.time, "interrupted; all samples up to here are kept")
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

    def _run(self) -> Outcome | GivesUp:
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
        return Outcome(Ending.FINISHED, self.setup.duration_s)

    def _go(self, budget: int) -> Ended | Stiff:
        """So many steps, with a rest whenever there is no room for what is observed and recorded."""
        observer = self.observer
        while True:
            if (replaced := self._replaced()) is not None:
                return replaced
            self.position.budget[0] = steps = self._room(budget)
            if observer is not None:
                self.position.column[0] = observer.filled
            ended = self._advance()
            if observer is not None:
                observer.filled = int(self.position.column[0])
                observer.look()
            budget -= steps
            if ended is not Ended.PAUSED or budget <= 0:
                return ended

    def _tick(self) -> None:
        """Do a tick by the interpreted equation."""
        s = int(self.position.segment[0])
        self.lanes.y[:, 0], held = self.watch.tick(float(self.table.starts[s]), self.y)
        self.lanes.run_parameters[: self.config.held, 0] = held
        self.table.ticks[s] = 0

    def _change_payload(self) -> list[Occurrence]:
        """Go on with what is carried from the start of a segment on; what happened."""
        s = int(self.position.segment[0])
        self.lanes.y[:, 0], happened = self.payloads.over(float(self.table.starts[s]), self.y)
        self.equation = self.watch.equation = self.payloads.equation
        self.functions, self.in_python, self.lanes.run_parameters[self.config.held :, 0], _ = self.engine.evaluated(
            self.equation, self.watch
        )
        self.table.payload_events[s] = 0
        return happened

    def _recording(self, outcome: Outcome) -> Recording:
        records, rows = self.records, int(self.position.sample_row[0])
        if not rows and len(records.t):  # interrupted, or without a tick, before the first sample
            records.t[0], records.y[0, :, 0], records.sampled[0], rows = 0.0, self.start, np.nan, 1
        shared, step_log, ends = self._paths()
        return Recording(
            outcome=outcome,
            t=records.t[:rows],
            y=records.y[:rows, :, 0],
            made=records.sampled[:rows, :, 0],
            shared=shared,
            step_log=step_log,
            steps=int(self.position.steps[0]),
            evaluations=int(self.position.evaluations[0]),
            kinetic_peak=float(self.lanes.peak[0]),
            events=tuple(self.events),
            ends=ends,
        )


def _config(setup: Setup) -> LoopConfig:
    """The settings of the loop of a run by itself, which shares no states."""
    return loop_config(setup.equation, True)
