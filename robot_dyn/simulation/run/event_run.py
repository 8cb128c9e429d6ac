"""The driver of a run whose steps are chosen by error control, or cut at events.

At an event the effects change their mode: their formula on the other side of a switch is chosen by their coefficients,
so that within a step the right-hand side is smooth.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any, final

import numpy as np

from robot_dyn.foundations.errors import RobotDynError, is_mistake
from robot_dyn.foundations.values import cached, copied
from robot_dyn.integrate import hermite
from robot_dyn.integrate.adaptive import STEPPERS
from robot_dyn.integrate.bernstein import room
from robot_dyn.integrate.step_control import At, ControlledStepper, control_of
from robot_dyn.simulation.dynamics.loop_state import Ended, Now
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.engine.interpreted import interpreted, system
from robot_dyn.simulation.events.crossings import Switches
from robot_dyn.simulation.events.event_log import event_log
from robot_dyn.simulation.events.mode_change import end_mode, without_modes
from robot_dyn.simulation.events.modes import NOTHING_HELD, modes_of
from robot_dyn.simulation.events.payload_events import PayloadEvents
from robot_dyn.simulation.events.switching import Switching
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.run.event_loop import Times, event_loop
from robot_dyn.simulation.run.outcome import GivesUp, Outcome, Reason, Stiff, TooLong
from robot_dyn.simulation.run.recording import MOST_SHARED, Path, sample
from robot_dyn.simulation.run.stiffness import FIRST_LOOK, changes_over
from robot_dyn.simulation.run.switched_run import SwitchedRun
from robot_dyn.simulation.run.watch import DivergedError, Watch, one_step
from robot_dyn.simulation.setup.schedule import nodes
from robot_dyn.simulation.setup.segment_table import segment_table
from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.simulation.setup.setup import samples as most_samples

_SAMPLES = 1000  # of a run without a record period
_COMPARED = 1000  # times at which a run is compared with runs of other tolerances
_BRIEF = 1e-9  # of a run: events of one threshold in that part of it chatter
_ACCUMULATED = 1000  # changes of the mode, in that part of the run: no motion that ends them is left between
_CHUNK = 1024  # ends of steps for which there is room at first


def _on(times: np.ndarray, path: Path) -> Path:
    """The states of a path that lie on nodes; their keys are the steps before these."""
    key = np.minimum(np.searchsorted(times, path.t), len(times) - 1)
    met = np.flatnonzero((times[key] == path.t) & np.append(np.diff(path.t) > 0, True))
    return Path(key[met], path.t[met], path.y[met])


@final
class EventRun(SwitchedRun):
    """A run in progress.

    Args:
        watch: As of `Driver`.
        payloads: As of `Driver`.
        engine: As of `Driver`.
        mesh: Where steps end, (k,), before error control ends them; None for error control alone.
        on_progress: As of `Driver`.
        observer: As of `Driver`.
        samples: Whether samples are recorded.
        most: Evaluations after which it gives up as `TooLong`.
        thresholds: Whether those of the effects are found; otherwise the effects switch by themselves within steps.
        chooses: Whether it gives up as `Stiff` or `Accumulation` where another method is to make the run.
    """

    first = 200

    def __init__(
        self, watch: Watch, payloads: PayloadEvents, engine: Engine, mesh: np.ndarray | None,
        on_progress: Callable[[float], object] | None = None, observer: Observer | None = None,
        samples: bool = True, most: float = inf, thresholds: bool = True, chooses: bool = False,
    ) -> None:  # fmt: skip
        setup, equation = watch.setup, watch.equation
        super().__init__(watch, payloads, engine, segment_table(setup), on_progress, observer)
        self.most, self.samples, self.chooses = most, samples, chooses
        self._look = FIRST_LOOK if chooses else 0
        self.stepper, self.control = _method(setup, equation)
        self.bodies, of = self.functions.bodies, self.stepper
        modes, brief = None, _BRIEF * setup.duration_s
        if equation.impulses:
            modes = modes_of(equation, self.runs.run_parameters.copy(), engine.places(), _ACCUMULATED, brief)
            modes.start(self.start)
        alone = thresholds and modes is None and not payloads.any
        self.switching = cached(setup, _switching) if alone else Switching(equation, modes=modes)
        if not thresholds:
            self.switching = Switching(equation, self.switching.quantities, modes)
        ends_mode = without_modes if modes is None else end_mode
        self.advance = engine.loop(lambda: event_loop(of.begin, of.step, of.error, of.accept, of.dense, ends_mode))
        self.times = _times(setup, mesh, samples)
        states = 0 if self.times.compared == inf else _COMPARED + len(self.table.counts) + 2
        self.records = self._records(int(most_samples(setup)) + 2 if samples else 0, states, _CHUNK)
        events, degree = self.functions.events, len(of.work.F)
        if alone and not setup.events:
            known = copied(cached(setup, _switches))
            self.switches = known._replace(functions=events, b=np.zeros(degree + 1), stack=room(degree))
        else:
            self.switches = self.switching.at(0.0, self.start, degree, events, self.held)
        self.log = event_log(self.rules.n, 0, brief) if modes is None else modes.holding.log
        self._forget_sides()
        self._change_mode()

    @property
    def time(self) -> float:
        """The time reached, in [s]."""
        return float(self.times.reached[0])

    def _room(self, budget: int) -> int:
        self._widen()
        rest = len(self.records.step_log_t) - int(self.now[Now.WALKED]) or budget
        if self._look:
            rest = min(rest, self._look - int(self.now[Now.STEPS]))
        return min(rest, super()._room(budget))

    def _replaced(self) -> Stiff | None:
        if not self._look or self.now[Now.STEPS] < self._look:
            return None
        self._look *= 2
        ends = self.records.step_log_t[: int(self.now[Now.WALKED])]
        return changes_over(self.setup, self.switching.on(self.switches.sides), ends, self.y, self.held)

    def _widen(self) -> None:
        """Double the room for ends of steps, where it is used up."""
        records, rows = self.records, len(self.records.step_log_t)
        if self.now[Now.WALKED] == rows:
            states = max(len(records.step_log), min(2 * rows, MOST_SHARED))
            t, y = np.empty(2 * rows), np.empty((states, len(self.start)))
            t[:rows], y[: len(records.step_log)] = records.step_log_t, records.step_log
            self.records = records._replace(step_log_t=t, step_log=y)

    def _advance(self) -> Ended:
        arguments = self.functions, self.table, self.runs, self.records, self.times, self.rules
        modes = self.switching.modes
        holding = NOTHING_HELD if modes is None else modes.holding
        arguments += self.stepper.coefficients, self.stepper.work, self.switches, self.sides, holding
        try:
            return Ended(self.advance(*arguments, self.now, self.control, self.stop))
        except RobotDynError as error:
            if is_mistake(error):
                raise
            if not self.setup.integrator.controls_error:
                self._review_step()
            raise DivergedError(Outcome(Reason.CANNOT_EVALUATE, self.time, facts={"error": str(error)})) from None
        finally:
            self._take_log()

    def _review_step(self) -> None:
        """A step of a method of fixed step that was not found: DivergedError, which explains it."""
        s, t, y = int(self.now[Now.SEGMENT]), self.time, self.y
        equation = self.switching.on(self.switches.sides)
        p, functions = self.table.parameters[s], interpreted(equation, self.watch)
        right_side = system(functions, equation, p, self.runs.run_parameters[: self.rules.held])
        h = float(self.control[At.TAKEN])
        one_step(self.setup.integrator, right_side, t, y, h, self.watch)
        raise self.watch.diverged(Reason.STATE_OVERFLOWS, t, y)

    def _judge(self, ended: Ended) -> Outcome | GivesUp | None:
        if self.now[Now.EVALUATIONS] > self.most:
            return TooLong(int(self.now[Now.EVALUATIONS]))
        t, y = self.time, self.y
        if not t <= self.setup.duration_s * (1 + 1e-9):  # of an event that was looked for in states that overflow
            known = [0.0, *self.records.t[: int(self.now[Now.ROW])], *(event.t for event in self.events)]
            t = float(max(time for time in known if time <= self.setup.duration_s))
            if not self.setup.integrator.controls_error:
                raise self.watch.diverged(Reason.STATE_OVERFLOWS, t, y)
            raise DivergedError(Outcome(Reason.STATE_OVERFLOWS, t, facts={"largest": inf}))
        if t > self.past_horizon + self.setup.duration_s / _COMPARED:
            return Outcome(Reason.END, self.past_horizon)
        self.watch.pace(t, y, int(self.now[Now.STEPS]))
        largest: dict[str, float | str] = {"largest": float(np.abs(y).max())}
        if ended is Ended.EVENT:
            if (name := self._event(t, y)) is not None:
                self._sample_end(t)
                return Outcome(Reason.TERMINAL_EVENT, t, facts={"event": name})
        elif ended in (Ended.CHANGED, Ended.ACCUMULATED, Ended.UNSETTLED):
            return self._end_mode(ended, t, y)
        elif ended is Ended.PAYLOAD:
            self._change_carried()
        elif ended is Ended.TICK:
            self._tick()
        elif ended is Ended.GAINS:
            self.watch.look(t, y)
        elif ended is Ended.TOO_SMALL and not self.setup.integrator.controls_error:
            self._review_step()
        elif self.met is not None and ended in (Ended.TOO_SMALL, Ended.NOT_FINITE):
            raise DivergedError(Outcome(Reason.CANNOT_EVALUATE, t, facts={"error": str(self.met)}))
        elif ended is Ended.TOO_SMALL:
            raise DivergedError(Outcome(Reason.STEP_BELOW_FLOAT_SPACING, t, facts=largest))
        elif ended is Ended.NOT_FINITE:
            raise DivergedError(Outcome(Reason.RATE_NOT_FINITE, t, facts=largest))
        elif ended is Ended.FAST:
            raise DivergedError(Outcome(Reason.IMPLAUSIBLE_SPEED, t, facts={"limit": 1e6}))
        return None

    def _sample_end(self, t: float) -> None:
        """Record a sample where an event ends the run."""
        row, s, records = int(self.now[Now.ROW]), int(self.now[Now.SEGMENT]), self.records
        if not (row and records.t[row - 1] == t):
            sample(self.in_python, self.runs, records, 0, self.now, t, self.runs.y, self.table.parameters[s])

    def _paths(self) -> tuple[Path, Path, np.ndarray]:
        records, shared, steps = self.records, int(self.now[Now.SHARED]), int(self.now[Now.WALKED])
        ends = records.step_log_t[:steps]
        states = np.vstack([self.start, records.step_log[: min(steps, len(records.step_log))]])
        path = Path(np.full(len(states), -1), np.append(0.0, ends)[: len(states)], states)
        if not self.setup.integrator.controls_error:
            return _on(nodes(self.setup.segments), path), path, ends
        return Path(np.arange(shared), records.shared_t[:shared], records.shared[:shared]), path, ends


def _switching(setup: Setup) -> Switching:
    """Where the equation of a setup switches, in which nothing is held or carried."""
    return Switching(setup.equation)


def _switches(setup: Setup) -> Switches:
    """Its switching functions at the start, without user-defined events."""
    equation = setup.equation
    held = np.full(equation.plant.dynamics.n, np.nan) if equation.sampled else None
    return cached(setup, _switching).at(0.0, equation.start(setup.q0, setup.v0), 0, None, held)


def _method(setup: Setup, equation: StateEquation) -> tuple[ControlledStepper, np.ndarray]:
    """The stepper of the method, and the choice of its steps before the first."""
    method: Any = setup.integrator
    n, m = equation.plant.dynamics.n, equation.size
    if not method.controls_error:
        stepper = hermite.stepper(method, m, n, m + n, equation.widths)
        return stepper, control_of(stepper, 0.0, 0.0, inf)
    bounded = m - len(equation.sources)
    stepper = STEPPERS[method.method](m, m + n, bounded)
    still = equation.state_size if equation.sampled else 0  # between ticks: without them in the mean of squares
    part = np.sqrt(1 - still / bounded)
    longest = min(method.max_step_s, setup.longest_step_s)
    return stepper, control_of(stepper, part * method.rtol, part * method.atol, longest)


def _times(setup: Setup, mesh: np.ndarray | None, samples: bool) -> Times:
    """The times of a run: those of a method of fixed step all lie on its mesh."""
    chosen, every = setup.integrator.controls_error, not setup.record_period_s
    period = setup.record_period_s or (setup.duration_s / _SAMPLES if chosen else inf)
    compared = setup.duration_s / _COMPARED if chosen and setup.estimate_error else inf
    return Times(
        np.zeros(1), period if samples else inf, compared, samples and every, samples and every and not chosen,
        setup.duration_s, np.zeros(0) if mesh is None else mesh,
    )  # fmt: skip
