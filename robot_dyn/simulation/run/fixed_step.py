"""A run of fixed steps, followed by Python: the time loop comes back for progress, for Ctrl-C, and for what it doubts.

What the loop finds doubtful (a number that overflows, stages that are not found, energy that grows) is done again by
the interpreted state equation, which alone ends a run, and words why.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import ceil, inf
from typing import cast, final

import numpy as np

from robot_dyn.arithmetic import FLOAT64, Array
from robot_dyn.errors import RobotDynError, is_mistake
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.simulation.dynamics.loop_state import Ended, Functions, Now, Rules, Runs
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.events.payload_events import PayloadEvents
from robot_dyn.simulation.observation.observation import NOTHING
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.run.driver import Driver
from robot_dyn.simulation.run.outcome import Ending, Outcome
from robot_dyn.simulation.run.recording import MOST_SHARED, Path, Recording
from robot_dyn.simulation.run.state_functions import interpreted, sample, system
from robot_dyn.simulation.run.time_loop import WATCHED, Records, acts, time_loop
from robot_dyn.simulation.run.watch import LARGEST, DivergedError, Watch, one_step, overflowed
from robot_dyn.simulation.setup.schedule import ON_STEP, paced
from robot_dyn.simulation.setup.segment_table import segment_table
from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.values import aligned, cached

_NEEDS_REVIEW = 1e6  # of Σ |y| in machine code, which does not see that M becomes singular

_FIRST = np.zeros(1, np.int64)

Advance = Callable[..., int]
Made = Callable[[StateEquation], tuple[Functions, np.ndarray]]


@final
class FixedStep(Driver):
    """A run on its way.

    Args:
        watch: Of the setup, and its state equation.
        transfers: What it carries.
        made: Gives the functions of a state equation, for the loop, and their parameters (P,).
        pace: Length of a step, in steps of the setup; 1 keeps samples.
        machine_code: The time loop of the method as machine code; then the functions are, too.
        on_progress: Called with the time reached, at each step or some ten times a second.
        observer: Sees each step.
    """

    first = 1000

    def __init__(
        self, watch: Watch, transfers: PayloadEvents, made: Made, pace: Fraction,
        machine_code: Advance | None = None, on_progress: Callable[[float], object] | None = None,
        observer: Observer | None = None,
    ) -> None:  # fmt: skip
        setup, equation = watch.setup, watch.equation
        method = cast(Integrator, setup.integrator)
        self.setup, self.equation, self.compiled = setup, equation, machine_code is not None
        self.transfers, self.made, self.events = transfers, made, []
        self.functions, parameters = made(equation)
        self.on_progress, self.observer = on_progress, observer
        self.segments, self.table, self.watch = paced(setup.segments, pace), segment_table(setup, pace), watch
        n, m = equation.plant.dynamics.n, equation.size
        held = n if equation.sampled else 0
        self.start = equation.start(setup.q0, setup.v0)
        run_parameters = np.concatenate([np.full(held, np.nan), parameters])[:, None]
        self.runs = runs_of(equation, self.start[:, None], run_parameters, m + n + 2)
        self.runs.energy[0], self.runs.scale[0] = self.watch.energy, self.watch.scale
        self.stepper = method.stepper(FLOAT64, m, n, m + n, 1, equation.widths)
        self.advance = machine_code or time_loop(self.stepper.step)
        every, thin = self._shared(pace)
        largest = _NEEDS_REVIEW if self.compiled else LARGEST
        self.rules = cached(setup, rules_alone)._replace(largest=largest, every=every, thin=thin)
        rows = samples_at_most(setup, self.table.counts) if pace == 1 else 1
        states = int((-(-self.table.counts // every)).sum()) // thin + 2
        shown = (np.empty((1 + 3 * n, 0)), NOTHING) if observer is None else (observer.columns, observer.observation)
        self.records = Records(
            np.arange(m), np.empty((rows, 2), np.int64), np.empty((rows, m, 1)), np.empty((rows, m + n + 2, 1)),
            np.empty((states, m + 2)), *shown,
        )  # fmt: skip
        self.now, self.stop = np.zeros(len(Now), np.int64), np.zeros(1, np.int64)
        self.clock = np.array([0.0 if pace == 1 else inf, setup.record_period_s, ON_STEP * setup.nominal_step_s])

    def _shared(self, pace: Fraction) -> tuple[int, int]:
        """Steps between states that companions share, and how many of these to one that is kept."""
        counts = self.table.counts
        few = self.setup.steps <= MOST_SHARED
        thin = 1 if few else 30 * ceil(self.setup.steps / MOST_SHARED)  # steps of 2, 3 and 5 meet at every 30th
        among = 2 * ceil(len(counts) / MOST_SHARED) if len(counts) > MOST_SHARED else 1
        return max(1, int(thin / pace)), among

    @property
    def time(self) -> float:
        """The time reached, in [s]."""
        s, k = min(int(self.now[Now.SEGMENT]), len(self.table.starts) - 1), int(self.now[Now.STEP])
        if k == self.table.counts[s]:
            return float(self.table.starts[min(s + 1, len(self.table.starts) - 1)])
        return float(self.table.starts[s] + k * self.table.lengths[s])

    @property
    def y(self) -> np.ndarray:
        """The state reached."""
        return self.runs.y[:, 0].copy()

    def record(self) -> Recording:
        """Run to the end, however the run ends."""
        try:
            with np.errstate(all="ignore"):
                self._loop()
            outcome = Outcome(Ending.FINISHED, self.setup.duration_s)
        except DivergedError as end:
            outcome = Outcome(Ending.DIVERGED, end.t, str(end))
        except KeyboardInterrupt:
            outcome = Outcome(Ending.STOPPED, self.time, "interrupted; all samples up to here are kept")
        return self._record(outcome)

    def _advance(self) -> Ended:
        _, coefficients, work = self.stepper
        arguments = self.functions, self.table, self.runs, self.records, self.rules, coefficients, work
        try:
            return Ended(self.advance(*arguments, self.now, self.clock, self.stop))
        except RobotDynError as error:  # of a step; y is the state before it
            if is_mistake(error):
                raise
            return Ended.NEEDS_REVIEW

    def _judge(self, ended: Ended) -> None:
        """Do a doubtful step, tick or look at the energy by the interpreted equation."""
        if ended is Ended.PAUSED:
            return
        s, t, y = int(self.now[Now.SEGMENT]), self.time, self.y
        if ended is Ended.TICK:
            y, held = self.watch.tick(t, y)
            self.runs.y[:, 0], self.runs.run_parameters[: self.rules.held, 0] = y, held
            self.table.ticks[s] = 0
        elif ended is Ended.TRANSFER:
            self.runs.y[:, 0], happened = self.transfers.over(t, y)
            self.events += happened
            self.equation = self.watch.equation = self.transfers.equation
            self.functions, self.runs.run_parameters[self.rules.held :, 0] = self.made(self.equation)
            self.table.transfers[s] = 0
        elif ended is Ended.NEEDS_REVIEW:
            self._step(s, t, y)
        else:
            self.watch.look(t, y)

    def _step(self, s: int, t: float, y: np.ndarray) -> None:
        """One step by the interpreted equation."""
        h, method, observer = float(self.table.lengths[s]), cast(Integrator, self.setup.integrator), self.observer
        seen = None if observer is None else observer.seen
        functions, p = interpreted(self.equation, self.watch), self.table.parameters[s]
        if method.nonsmooth:
            self.runs.y[:, 0] = y = self._jump(functions, t, h, p)
        else:
            right_side = system(functions, self.equation, p, self.runs.run_parameters, seen)
            self.runs.y[:, 0] = y = one_step(method, right_side, t, y, h, self.watch)
        if observer is not None:
            ticked = self.now[Now.STEP] == 0 and acts(self.rules, int(self.table.ticks[s]))
            observer.step(t, t + h, y, ticked or not self.equation.sampled)
        self.now[Now.STEP] += 1
        self.now[Now.STEPS] += 1
        if self.now[Now.STEPS] % WATCHED == 0:
            self.watch.look(t + h, y)

    def _jump(self, functions: Functions, t: float, h: float, p: Array) -> Array:
        """The state behind a step in which velocities may jump."""
        (step, coefficients, work), runs = self.stepper, self.runs
        arguments = functions, coefficients, t, h, runs.y, p, runs.run_parameters, runs.after, work, runs.lost
        self.watch.answer(t, self.y, lambda: step(*arguments))
        if runs.lost[0] or overflowed(runs.after):
            raise self.watch.diverged(t, self.y, "a number overflowed")
        return runs.after[:, 0].copy()

    def _times(self, places: np.ndarray) -> np.ndarray:
        """Times of (segment, step), in [s]."""
        return self.table.starts[places[:, 0]] + places[:, 1] * self.table.lengths[places[:, 0]]

    def _keys(self, places: np.ndarray) -> np.ndarray:
        """Steps of the setup before (segment, step)."""
        first = np.array([*(each.first for each in self.segments), self.setup.steps])[places[:, 0]]
        pace = np.array([*(float(each.pace) for each in self.segments), 1.0])[places[:, 0]]
        return first + np.rint(places[:, 1] * pace).astype(np.int64)

    def _accelerate(self, rows: int) -> None:
        """The rates at samples, where machine code has none: which joints rest is for the equation to find."""
        kept, held = self.records, slice(self.equation.size, self.equation.size + self.equation.plant.dynamics.n)
        for t, y, made in zip(self._times(kept.place[:rows]), kept.y[:rows, :, 0], kept.made[:rows, :, 0], strict=True):
            sample(self.equation, float(t), y, made[held].copy() if self.equation.sampled else None, made)

    def _record(self, outcome: Outcome) -> Recording:
        rows, m, kept = int(self.now[Now.ROW]), self.equation.size, self.records
        if not rows:  # interrupted, or without a tick, at once
            kept.place[0], kept.y[0, :, 0], kept.made[0] = 0, self.start, np.nan
            rows = 1
        if self.compiled and cast(Integrator, self.setup.integrator).nonsmooth:
            self._accelerate(rows)
        shared = kept.shared[: int(self.now[Now.SHARED])]
        at = shared[:, m:].astype(np.int64)
        path = Path(self._keys(at), self._times(at), shared[:, :m])
        return Recording(
            outcome, self._times(kept.place[:rows]), kept.y[:rows, :, 0], kept.made[:rows, :, 0], path, path,
            int(self.now[Now.STEPS]), int(self.now[Now.EVALUATIONS]), float(self.runs.peak[0]), tuple(self.events),
        )  # fmt: skip


def rules_alone(setup: Setup) -> Rules:
    """The rules of the loop of a run by itself, which shares no states."""
    return rules_of(setup.equation, True, inf)


def rules_of(
    equation: StateEquation, alone: bool, largest: float, every: int = 0, thin: int = 1, base: int = 0, apart: int = 0
) -> Rules:
    """The rules of a loop over a state equation."""
    n, controller = equation.plant.dynamics.n, equation.controller
    of = (1, 0, 0) if controller is None else (len(controller.instants), controller.acting_instant, controller.deviates)
    return Rules(
        n, len(equation.sources), equation.state_size, n if equation.sampled else 0, *of,
        equation.canonical, alone, largest, every, thin, base, apart,
    )  # fmt: skip


def runs_of(
    equation: StateEquation, y: np.ndarray, run_parameters: np.ndarray, made: int, numbers: np.ndarray = _FIRST
) -> Runs:
    """Runs at the states y (m, W) with their own numbers (O, W), of these numbers in a batch (W,)."""
    m, W = y.shape
    held, states = equation.plant.dynamics.n if equation.sampled else 0, equation.state_size
    seed, run = (0, 0) if equation.controller is None else equation.controller.noise_key
    keys = np.array([np.full(W, seed, np.uint64), np.uint64(run) + numbers.astype(np.uint64)])
    start, after = aligned((2, m, W))
    start[...] = y
    return Runs(
        start, np.array(run_parameters, order="C"), after, np.empty((made, W)),
        np.empty((held + states, W)), np.empty((equation.plant.dynamics.n, W)), np.empty((2, W)), np.empty(W),
        np.zeros(W, np.int64), np.ones(W, np.int64), np.zeros(W, np.int64), np.zeros(W), np.zeros((m, W)),
        np.zeros(W), np.ones(W), np.zeros(W), keys,
    )  # fmt: skip


def samples_at_most(setup: Setup, counts: np.ndarray) -> int:
    """At most so many samples."""
    steps = int(counts.sum())
    return min(steps, int(setup.duration_s / setup.record_period_s) + 2) if setup.record_period_s else steps
