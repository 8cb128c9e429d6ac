"""The driver of a run of fixed steps without events.

What the loop finds doubtful (a number that overflows, stages that are not found, energy that grows) is done again by
the interpreted state equation, which alone ends a run, and reports why.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import ceil, inf
from typing import cast, final

import numpy as np

from robot_dyn.foundations.arithmetic import FLOAT64, Array
from robot_dyn.foundations.errors import RobotDynError, is_mistake
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.simulation.dynamics.loop_state import Ended, Functions
from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.engine.interpreted import interpreted, sample, system
from robot_dyn.simulation.events.payload_events import PayloadEvents
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.run.driver import Driver
from robot_dyn.simulation.run.outcome import Outcome
from robot_dyn.simulation.run.recording import MOST_SHARED, Path, Recording
from robot_dyn.simulation.run.time_loop import WATCHED, changes_torque, time_loop
from robot_dyn.simulation.run.watch import LARGEST, Watch, one_step, overflowed
from robot_dyn.simulation.setup.schedule import ON_STEP, paced
from robot_dyn.simulation.setup.segment_table import segment_table
from robot_dyn.simulation.setup.setup import Setup


@final
class FixedStep(Driver):
    """A run in progress.

    Args:
        watch: As of `Driver`.
        payloads: As of `Driver`.
        engine: As of `Driver`.
        pace: Length of a step, in steps of the setup; 1 records samples.
        on_progress: As of `Driver`.
        observer: As of `Driver`.
    """

    first = 1000

    def __init__(
        self, watch: Watch, payloads: PayloadEvents, engine: Engine, pace: Fraction,
        on_progress: Callable[[float], object] | None = None, observer: Observer | None = None,
    ) -> None:  # fmt: skip
        setup, equation = watch.setup, watch.equation
        table = segment_table(setup, pace)
        super().__init__(watch, payloads, engine, table, on_progress, observer)
        self.segments, n, m = paced(setup.segments, pace), self.config.n, equation.size
        self.stepper = cast(Integrator, setup.integrator).stepper(FLOAT64, m, n, m + n, 1, equation.widths)
        self.advance = engine.loop(lambda: time_loop(self.stepper.step))
        every, thin = self._shared(pace)
        largest = min(engine.doubtful, LARGEST)
        period, slack = float(setup.record_period_s or 0.0), ON_STEP * setup.nominal_step_s
        self.config = self.config._replace(
            largest=largest, every=every, thin=thin, sample_period=period, sample_slack=slack
        )
        self.position.sample_time[0] = 0.0 if pace == 1 else inf
        rows = samples_at_most(setup, table.counts) if pace == 1 else 1
        self.loop = self._loop_of(rows, int((-(-table.counts // every)).sum()) // thin + 2, 0)

    def _shared(self, pace: Fraction) -> tuple[int, int]:
        """Steps between states that companions share, and how many of these to one that is stored."""
        counts = self.table.counts
        few = self.setup.steps <= MOST_SHARED
        thin = 1 if few else 30 * ceil(self.setup.steps / MOST_SHARED)  # steps of 2, 3 and 5 meet at every 30th
        among = 2 * ceil(len(counts) / MOST_SHARED) if len(counts) > MOST_SHARED else 1
        return max(1, int(thin / pace)), among

    @property
    def time(self) -> float:
        """The time reached, in [s]."""
        s, k = min(int(self.position.segment[0]), len(self.table.starts) - 1), int(self.position.step[0])
        if k == self.table.counts[s]:
            return float(self.table.starts[min(s + 1, len(self.table.starts) - 1)])
        return float(self.table.starts[s] + k * self.table.lengths[s])

    def _advance(self) -> Ended:
        _, coefficients, work = self.stepper
        try:
            return Ended(self.advance(self.functions, coefficients, work, self.loop, self.stop))
        except RobotDynError as error:  # of a step; y is the state before it
            if is_mistake(error):
                raise
            return Ended.NEEDS_REVIEW

    def _judge(self, ended: Ended) -> None:
        """Do a doubtful step, tick or look at the energy by the interpreted equation."""
        if ended is Ended.TICK:
            self._tick()
        elif ended is Ended.PAYLOAD:
            self.events += self._change_payload()
        elif ended is Ended.NEEDS_REVIEW:
            self._step(int(self.position.segment[0]), self.time, self.y)
        elif ended is not Ended.PAUSED:
            self.watch.look(self.time, self.y)

    def _step(self, s: int, t: float, y: np.ndarray) -> None:
        """One step by the interpreted equation."""
        h, method, observer = float(self.table.lengths[s]), cast(Integrator, self.setup.integrator), self.observer
        seen = None if observer is None else observer.seen
        functions, p = interpreted(self.equation, self.watch), self.table.parameters[s]
        if method.nonsmooth:
            self.lanes.y[:, 0] = y = self._jump(functions, t, h, p)
        else:
            right_side = system(functions, self.equation, p, self.lanes.run_parameters, seen)
            self.lanes.y[:, 0] = y = one_step(method, right_side, t, y, h, self.watch)
        if observer is not None:
            ticked = self.position.step[0] == 0 and changes_torque(self.config, int(self.table.ticks[s]))
            observer.step(t, t + h, y, ticked or not self.equation.sampled)
        self.position.step[0] += 1
        self.position.steps[0] += 1
        if self.position.steps[0] % WATCHED == 0:
            self.watch.look(t + h, y)

    def _jump(self, functions: Functions, t: float, h: float, p: Array) -> Array:
        """The state behind a step in which velocities may jump."""
        (step, coefficients, work), lanes = self.stepper, self.lanes
        lanes.p[:] = p
        self.watch.answer(t, self.y, lambda: step(functions, coefficients, work, t, h, lanes))
        if lanes.failed[0] or overflowed(lanes.after):
            raise self.watch.diverged(t, self.y, "a number overflowed")
        return lanes.after[:, 0].copy()

    def _keys(self, places: np.ndarray) -> np.ndarray:
        """Steps of the setup before (segment, step)."""
        first = np.array([*(each.first for each in self.segments), self.setup.steps])[places[:, 0]]
        pace = np.array([*(float(each.pace) for each in self.segments), 1.0])[places[:, 0]]
        return first + np.rint(places[:, 1] * pace).astype(np.int64)

    def _paths(self) -> tuple[Path, Path, None]:
        records, rows = self.records, int(self.position.shared_row[0])
        path = Path(self._keys(records.shared_place[:rows]), records.shared_t[:rows], records.shared[:rows])
        return path, path, None

    def _recording(self, outcome: Outcome) -> Recording:
        recording = super()._recording(outcome)
        if self.setup.integrator.nonsmooth:
            # machine code has no rates at samples: which joints rest is for the equation to find
            m, n = self.equation.size, self.config.n
            for t, y, made in zip(recording.t, recording.y, recording.made, strict=True):
                if np.isnan(made[:m]).all():
                    sample(self.equation, float(t), y, made[m : m + n].copy() if self.config.held else None, made)
        return recording


def samples_at_most(setup: Setup, counts: np.ndarray) -> int:
    """At most so many samples."""
    steps = int(counts.sum())
    return min(steps, int(setup.duration_s / setup.record_period_s) + 2) if setup.record_period_s else steps
