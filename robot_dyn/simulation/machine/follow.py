"""A run in machine code, followed by Python: it comes back for progress, for Ctrl-C, and for what it cannot judge.

What machine code finds doubtful (a number that overflows, stages that are not found, energy that grows) is done again
by the interpreted engine, which alone ends a run, and words why.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import ceil
from time import perf_counter
from typing import final

import numpy as np

from robot_dyn.integrate.integrator import Integrator
from robot_dyn.simulation.machine.machine import Machine
from robot_dyn.simulation.machine.places import WATCHED, Ended, Now
from robot_dyn.simulation.machine.timetable import Timetable, timetable
from robot_dyn.simulation.march import DivergedError, Watch, one_step
from robot_dyn.simulation.motion import Motion
from robot_dyn.simulation.observer import Observer
from robot_dyn.simulation.record import MOST_SHARED, Path, Record
from robot_dyn.simulation.schedule import paced
from robot_dyn.simulation.setup import Setup
from robot_dyn.simulation.trajectory import Ending, Outcome

_PAUSE_S = 0.1  # between looks at the keyboard
_FIRST = 1000  # steps before the speed is known


def follow(
    setup: Setup,
    motion: Motion,
    machine: Machine,
    pace: Fraction,
    thin: int,
    on_progress: Callable[[float], object] | None = None,
    observer: Observer | None = None,
) -> Record:
    """Run a setup in machine code.

    Args:
        setup: What to run.
        motion: Its equation of motion.
        machine: The same compiled.
        pace: Length of a step, in steps of the setup; 1 keeps samples.
        thin: Steps of the setup between the states of `Record.shared`.
        on_progress: Called with the time reached now and then.
        observer: Sees each step.
    """
    return _Run(setup, motion, machine, pace, thin, observer).record(on_progress)


@final
class _Run:
    """A run on its way."""

    def __init__(
        self, setup: Setup, motion: Motion, machine: Machine, pace: Fraction, thin: int, observer: Observer | None
    ) -> None:
        self.setup, self.motion, self.machine, self.observer = setup, motion, machine, observer
        self.stretches = paced(setup.stretches, pace)
        self.table, self.watch = timetable(setup, pace), Watch(setup, motion)
        self.start = motion.start(setup.q0, setup.v0)
        self.work = machine.work(self.start)
        places, counts = machine.program.places, self.table.counts
        self.m, self.held_at = places.state, slice(places.x + places.state, places.x + places.state + places.held)
        self.now = np.zeros(len(Now), dtype=np.int64)
        every = max(1, int(thin / pace))
        among = 2 * ceil(len(counts) / MOST_SHARED) if len(counts) > MOST_SHARED else 1
        self.now[Now.EVERY], self.now[Now.THIN] = every, among
        rows, columns = _rows(setup, self.table) if pace == 1 else 0, [*range(self.m)]
        if places.held:
            columns += range(self.held_at.start, self.held_at.stop)
        energy = np.zeros((5, 1))
        energy[2], energy[3] = self.watch.energy, self.watch.scale
        self.arrays = {
            "lanes": energy,
            "which": np.array(columns, dtype=np.int64),
            "out_step": np.empty((rows, 2), np.int64),
            "out_y": np.empty((rows, len(columns), 1)),
            "out_shared": np.empty((int((-(-counts // every)).sum()) // among + 2, self.m + 2)),
            "clock": np.array([0.0 if pace == 1 else np.inf, setup.record_period_s, 1e-9 * setup.step_s]),
            "now": self.now,
        }
        if observer is not None:
            self.arrays["columns"] = observer.columns

    @property
    def time(self) -> float:
        """The time reached, in [s]."""
        stretch, step = int(self.now[Now.STRETCH]), int(self.now[Now.STEP])
        return self.setup.duration_s if stretch == len(self.table.starts) else self.table.time(stretch, step)

    @property
    def held(self) -> np.ndarray | None:
        """What a sampled controller holds."""
        return self.work[self.held_at].copy() if self.motion.sampled else None

    def record(self, on_progress: Callable[[float], object] | None) -> Record:
        """March to the end, however the run ends."""
        last = None
        try:
            with np.errstate(all="ignore"):
                self._march(on_progress)
                y, held = self.watch.tick(self.setup.duration_s, self.work[: self.m].copy())
                last = self.setup.duration_s, y, held
                if on_progress is not None:
                    on_progress(self.setup.duration_s)
            outcome = Outcome(Ending.FINISHED, self.setup.duration_s)
        except DivergedError as end:
            outcome = Outcome(Ending.DIVERGED, end.t, str(end))
        except KeyboardInterrupt:
            outcome = Outcome(Ending.STOPPED, self.time, "interrupted; all samples up to here are kept")
        return self._record(outcome, last)

    def _march(self, on_progress: Callable[[float], object] | None) -> None:
        budget = _FIRST
        while True:
            began = perf_counter()
            ended = self._go(budget)
            if ended is Ended.DONE:
                return
            if ended is Ended.PAUSED:
                spent = perf_counter() - began
                budget = int(np.clip(budget * _PAUSE_S / max(spent, 1e-9), _FIRST // 10, 100 * budget))
                if on_progress is not None:
                    on_progress(self.time)
            else:
                self._judge(ended)

    def _go(self, budget: int) -> Ended:
        """So many steps, or fewer, with a rest whenever the observer has all columns to look at."""
        observer = self.observer
        while True:
            self.now[Now.BUDGET] = steps = budget if observer is None else min(budget, observer.room)
            if observer is not None:
                self.now[Now.COLUMN] = observer.filled
            ended = self.machine.run(self.work, self.table, **self.arrays)
            if observer is not None:
                observer.filled = int(self.now[Now.COLUMN])
                observer.look()
            budget -= steps
            if ended is not Ended.PAUSED or budget <= 0:
                return ended

    def _judge(self, ended: Ended) -> None:
        """Do a doubtful step, tick or look at the energy in the interpreted engine; DivergedError ends the run."""
        stretch, t, y = int(self.now[Now.STRETCH]), self.time, self.work[: self.m].copy()
        if ended is Ended.TICK:
            y, held = self.watch.tick(t, y)
            self.machine.hold(self.work, held)
            self.table.ticks[stretch] = 0
        elif ended is Ended.DOUBTFUL:
            h, method = float(self.table.lengths[stretch]), self.setup.integrator
            assert isinstance(method, Integrator)
            seen = None if self.observer is None else self.observer.seen
            system = self.motion.system(self.held, self.stretches[stretch], seen)
            y = one_step(method, system, t, y, h, self.watch)
            if self.observer is not None:
                acted = self.held is None or (self.now[Now.STEP] == 0 and self.stretches[stretch].tick)
                self.observer.step(t + h, y, self.held, bool(acted))
            self.now[Now.STEP] += 1
            self.now[Now.STEPS] += 1
            if self.now[Now.STEPS] % WATCHED == 0:
                self.watch.look(t + h, y)
        else:
            self.watch.look(t, y)
        self.work[: self.m] = y

    def _times(self, places: np.ndarray) -> np.ndarray:
        """Times of (stretch, step), in [s]; not of machine code, which rounds once where Python rounds twice."""
        return self.table.starts[places[:, 0]] + places[:, 1] * self.table.lengths[places[:, 0]]

    def _keys(self, places: np.ndarray) -> np.ndarray:
        """Steps of the setup before (stretch, step)."""
        first = np.array([each.first for each in self.stretches])[places[:, 0]]
        pace = np.array([float(each.pace) for each in self.stretches])[places[:, 0]]
        return first + np.rint(places[:, 1] * pace).astype(np.int64)

    def _record(self, outcome: Outcome, last: tuple[float, np.ndarray, np.ndarray | None] | None) -> Record:
        rows, m = int(self.now[Now.ROW]), self.m
        step = self.arrays["out_step"][:rows]
        t = self._times(step)
        y, seen = self.arrays["out_y"][:rows, :, 0], int(self.now[Now.SHARED])
        shared = self.arrays["out_shared"][:seen]
        at = shared[:, m:].astype(np.int64)
        path = Path(self._keys(at), self._times(at), shared[:, :m])
        if last is None and not rows:  # interrupted, or without a tick, at once
            t = np.zeros(1)
            y = np.concatenate([self.start, np.full(len(self.arrays["which"]) - m, np.nan)])[None]
        elif last is not None:
            t = np.append(t, last[0])
            y = np.vstack([y, np.concatenate([last[1], [] if last[2] is None else last[2]])])
            end = np.array([self.setup.steps]), np.array([last[0]]), last[1][None]
            path = Path(*(np.concatenate(both) for both in zip((path.key, path.t, path.y), end, strict=True)))
        held = y[:, m:] if self.motion.sampled else None
        return Record(
            outcome, t, y[:, :m], held, None, path, path,
            int(self.now[Now.STEPS]), int(self.now[Now.EVALUATIONS]),
        )  # fmt: skip


def _rows(setup: Setup, table: Timetable) -> int:
    """At most so many samples."""
    steps = int(table.counts.sum())
    return min(steps, int(setup.duration_s / setup.record_period_s) + 2) if setup.record_period_s else steps
