"""A run by a method that chooses its steps: the samples lie between their ends, by the method's own interpolation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import ceil
from typing import cast, final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.errors import RobotDynError
from robot_dyn.integrate.adaptive import Adaptive, Status
from robot_dyn.integrate.integrator import System
from robot_dyn.integrate.primitives import evaluate
from robot_dyn.simulation.observer import Observer
from robot_dyn.simulation.plan import plan_of
from robot_dyn.simulation.record import MOST_SHARED, Path, Record
from robot_dyn.simulation.setup import Setup
from robot_dyn.simulation.state_equation import StateEquation
from robot_dyn.simulation.state_functions import system
from robot_dyn.simulation.time_loop import Functions
from robot_dyn.simulation.trajectory import Ending, Outcome
from robot_dyn.simulation.watch import DivergedError, Watch

_NONE = np.zeros(0)
_RUNAWAY = 1e6  # [rad/s] or [m/s]: such a method would follow an exploding state without end
_SAMPLES = 1000  # of a run without a record period
_COMPARED = 1000  # times at which a run is compared with runs of other tolerances
_PEAKS = 200  # states at which the kinetic energy of a run is looked at
_LOCAL_ORDER = 8  # of DOP853: its steps grow as this root of the tolerance


@final
@dataclass
class _Samples:
    """What a run leaves behind, sample by sample."""

    place: list[float] = field(default_factory=list)
    y: list[Array] = field(default_factory=list)
    made: list[Array] = field(default_factory=list)
    shared: list[tuple[int, float, Array]] = field(default_factory=list)
    walked: list[tuple[int, float, Array]] = field(default_factory=list)


@final
class ScipySteps:
    """A run on its way.

    Args:
        setup: What to run.
        equation: Its state equation.
        functions: The same, in Python.
        pace: Factor of the tolerances; 1 keeps samples.
        on_progress: Called with the time reached at each step.
        observer: Sees each step.
        parameters: Of the functions, (P,).
    """

    def __init__(
        self, setup: Setup, equation: StateEquation, functions: Functions, pace: Fraction,
        on_progress: Callable[[float], object] | None = None, observer: Observer | None = None,
        parameters: Array = _NONE,
    ) -> None:  # fmt: skip
        self.setup, self.equation, self.functions, self.pace = setup, equation, functions, pace
        self.on_progress, self.observer = on_progress, observer
        self.watch, self.plan = Watch(setup, equation), plan_of(setup)
        self.t, self.y = 0.0, equation.start(setup.q0, setup.v0)
        self.held = equation.plant.dynamics.n if equation.sampled else 0
        self.own = np.concatenate([np.full(self.held, np.nan), parameters])[:, None]
        self.key = self.steps = self.evaluations = 0
        self.due = 0.0  # time of the next sample
        self.samples = _Samples()

    def record(self) -> Record:
        """Run to the end, however the run ends."""
        try:
            with np.errstate(all="ignore"):  # what overflows ends the run
                for s in range(len(self.plan.counts) - 1):
                    self._segment(s)
                self._end()
            outcome = Outcome(Ending.FINISHED, self.t)
        except DivergedError as end:
            outcome = Outcome(Ending.DIVERGED, end.t, str(end))
        except KeyboardInterrupt:
            outcome = Outcome(Ending.STOPPED, self.t, "interrupted; all samples up to here are kept")
        if self.pace == 1 and not self.samples.place:  # interrupted, or without a tick, at once
            self._keep(0.0, self.y, self.plan.parameters[0])
        return self._record(outcome)

    def _segment(self, s: int) -> None:
        start, end, p = float(self.plan.starts[s]), float(self.plan.starts[s + 1]), self.plan.parameters[s]
        self._tick(s)
        right_side = system(
            self.functions, self.equation, p, self.own, self.observer and self.observer.seen, exact=False
        )
        steps = self._method(end - start).steps(self._counted(right_side), start, self.y, end, stop=self._sane)
        self._keep(start, self.y, p)
        self._share(start, self.y)
        period, compared = (
            self.setup.record_period_s or self.setup.duration_s / _SAMPLES,
            self.setup.duration_s / _COMPARED,
        )
        due, last = ceil(start / period + 1e-9), ceil(end / period - 1e-9)  # multiples of the period inside
        met = ceil(start / compared + 1e-9)
        ticked = bool(self.plan.ticks[s])
        for t, y, piece in steps:
            self.steps += 1
            self._observe(t, y, ticked)
            ticked = False
            while due < last and due * period <= t:
                self._keep(due * period, piece(due * period), p)
                due += 1
            while met * compared < min(t, end):
                self._share(met * compared, piece(met * compared))
                met += 1
            if len(self.samples.walked) < MOST_SHARED:
                self.samples.walked.append((-1, t, y))
            self.t, self.y = t, y
            if self.on_progress is not None:
                self.on_progress(t)
            self.watch.pace(t, self.steps)
        if steps.status is Status.FAILED:
            raise DivergedError(steps.t, steps.message)
        if steps.status is Status.STOPPED:
            raise DivergedError(steps.t, f"a joint moves faster than {_RUNAWAY:g} rad/s: the control is unstable")

    def _end(self) -> None:
        self._tick(len(self.plan.counts) - 1)
        self.t = self.setup.duration_s
        self._keep(self.t, self.y, self.plan.parameters[-1])
        self._share(self.t, self.y)
        if self.on_progress is not None:
            self.on_progress(self.t)

    def _tick(self, s: int) -> None:
        if self.plan.ticks[s]:
            self.y, held = self.watch.tick(float(self.plan.starts[s]), self.y)
            self.own[: self.held, 0] = held

    def _method(self, length: float) -> Adaptive:
        """The method with the tolerances of this run, on a segment."""
        method, factor = cast(Adaptive, self.setup.integrator), float(self.pace)
        longest = min(method.max_step_s, self.setup.longest_step_s)
        if factor < 1:  # where the ends of segments bound the steps, a tolerance by itself changes nothing
            longest = min(longest, length)
        longest *= factor ** (1 / _LOCAL_ORDER)
        return method.with_tolerances(factor, longest)

    def _counted(self, right_side: System) -> System:
        def rate(t: float, y: Array) -> Array:
            self.evaluations += 1
            return right_side.rate(t, y)

        return replace(right_side, rate=rate)

    def _sane(self, _: float, y: Array) -> float:
        n = self.equation.plant.dynamics.n
        return 1.0 if np.abs(y[n : 2 * n]).max() < _RUNAWAY else -1.0

    def _keep(self, t: float, y: Array, p: Array) -> None:
        if self.pace == 1 and (t >= self.due - 1e-9 * self.setup.step_s or t == self.setup.duration_s):
            self.due += self.setup.record_period_s
            made = np.empty((self.equation.size + self.equation.plant.dynamics.n + 2, 1))
            evaluate(self.functions.sample, t, np.ascontiguousarray(y)[:, None], p, self.own, made)
            self.samples.place.append(t)
            self.samples.y.append(y)
            self.samples.made.append(made[:, 0])

    def _share(self, t: float, y: Array) -> None:
        self.samples.shared.append((self.key, t, y))
        self.key += 1

    def _observe(self, t: float, y: Array, ticked: bool) -> None:
        """Show a step, and the actuation at its end."""
        if self.observer is None:
            return
        held = self.own[: self.held, 0] if self.equation.sampled else None
        try:
            q, v, z, _ = self.equation.state(y)
            self.observer.seen[len(q) :] = self.equation.actuation(t, q, v, z, held)
        except RobotDynError:  # y may be far off where a run fails
            return
        self.observer.step(t, y, ticked)

    def _record(self, outcome: Outcome) -> Record:
        kept, m = self.samples, self.equation.size
        walked = sorted([*kept.walked, *kept.shared], key=lambda each: each[1])
        made = np.array(kept.made).reshape(len(kept.made), m + self.equation.plant.dynamics.n + 2)
        return Record(
            outcome, np.array(kept.place), np.array(kept.y).reshape(-1, m), made, _path(kept.shared, m),
            _path(walked, m), self.steps, self.evaluations, self._kinetic_peak(walked),
        )  # fmt: skip

    def _kinetic_peak(self, walked: list[tuple[int, float, Array]]) -> float:
        """Largest kinetic energy at some states of the run, which its samples may all miss; 0 if it is not known."""
        some = walked[:: max(1, len(walked) // _PEAKS)]
        y = np.array([each[2] for each in some]).reshape(-1, self.equation.size)
        try:
            q = y[:, : self.equation.plant.dynamics.n]
            energies = self.equation.plant.dynamics.kinetic_energy(q, self.equation.velocities(y))
            return float(np.max(energies, initial=0.0))
        except RobotDynError:  # a run that diverges may overflow
            return 0.0


def _path(states: list[tuple[int, float, Array]], m: int) -> Path:
    key, t, y = zip(*states, strict=True) if states else ((), (), ())
    return Path(np.array(key, np.int64), np.array(t, float), np.array(y, float).reshape(-1, m))
