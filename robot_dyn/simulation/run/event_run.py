"""A run whose steps are chosen or cut, followed by Python: the loop comes back for progress, Ctrl-C and events.

At an event the effects change their mode: what they are on the other side of a switch stands in their coefficients, so
that within a step the right-hand side is smooth.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any, final

import numpy as np

from robot_dyn.errors import RobotDynError, is_mistake
from robot_dyn.integrate import hermite
from robot_dyn.integrate.adaptive import STEPPERS
from robot_dyn.integrate.bernstein import room
from robot_dyn.integrate.step_control import At, ControlledStepper, control_of
from robot_dyn.simulation.dynamics.loop_state import Ended, Functions, Now
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.events.crossings import Switches
from robot_dyn.simulation.events.event_log import event_log
from robot_dyn.simulation.events.holding import Places
from robot_dyn.simulation.events.mode_change import end_mode, without_modes
from robot_dyn.simulation.events.modes import NOTHING_HELD, modes_of
from robot_dyn.simulation.events.occurrence import Occurrence
from robot_dyn.simulation.events.payload_events import PayloadEvents
from robot_dyn.simulation.events.switching import Switching
from robot_dyn.simulation.observation.observation import NOTHING
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.run.event_loop import Kept, Times, event_loop
from robot_dyn.simulation.run.fixed_step import rules_alone, runs_of
from robot_dyn.simulation.run.outcome import Ending, Outcome
from robot_dyn.simulation.run.recording import MOST_SHARED, Path, Recording
from robot_dyn.simulation.run.state_functions import interpreted, system
from robot_dyn.simulation.run.stiffness import FIRST_LOOK, changes_over
from robot_dyn.simulation.run.switched_run import Made, SwitchedRun, TerminalEvent
from robot_dyn.simulation.run.watch import DivergedError, Watch, one_step
from robot_dyn.simulation.setup.schedule import nodes
from robot_dyn.simulation.setup.segment_table import segment_table
from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.simulation.setup.size import samples as most_samples
from robot_dyn.values import cached, copied

_SAMPLES = 1000  # of a run without a record period
_COMPARED = 1000  # times at which a run is compared with runs of other tolerances
_BRIEF = 1e-9  # of a run: events of one threshold in that part of it chatter
_ACCUMULATED = 1000  # changes of the mode, in that part of the run: no motion that ends them is left between
_CHUNK = 1024  # ends of steps for which there is room at first

Advance = Callable[..., int]


def _on(times: np.ndarray, path: Path) -> Path:
    """The states of a path that lie on nodes; their keys are the steps before these."""
    key = np.minimum(np.searchsorted(times, path.t), len(times) - 1)
    met = np.flatnonzero((times[key] == path.t) & np.append(np.diff(path.t) > 0, True))
    return Path(key[met], path.t[met], path.y[met])


class TooLongError(Exception):
    """Internal: a run that takes more evaluations than were allowed."""

    def __init__(self, evaluations: int) -> None:
        super().__init__()
        self.evaluations = evaluations


@final
class EventRun(SwitchedRun):
    """A run on its way.

    Args:
        watch: Of the setup, and its state equation.
        transfers: What it carries.
        made: Gives the functions of a state equation, for the loop, and their parameters (P,).
        mesh: Where steps end, (k,), before error control ends them; None for error control alone.
        places: Where own numbers have the mode.
        samples: Whether samples are kept.
        machine_code: The loop of the method as machine code; then the functions are, too.
        on_progress: Called with the time reached, at each step or some ten times a second.
        observer: Sees each step.
        in_python: The functions as Python calls them, where they are machine code.
        most: Evaluations after which it gives up with a TooLongError.
        thresholds: Whether those of the effects are looked for; if not, the effects switch by themselves within steps.
        chooses: Whether it gives up with a StiffError or AccumulationError where another method is to make the run.
    """

    first = 200

    def __init__(
        self, watch: Watch, transfers: PayloadEvents, made: Made, mesh: np.ndarray | None,
        places: Places, machine_code: Advance | None = None,
        on_progress: Callable[[float], object] | None = None, observer: Observer | None = None,
        in_python: Functions | None = None, samples: bool = True, most: float = inf,
        thresholds: bool = True, chooses: bool = False,
    ) -> None:  # fmt: skip
        setup, equation, self.most, self._look = watch.setup, watch.equation, most, FIRST_LOOK if chooses else 0
        self.chooses = chooses
        self.watch, self.transfers, self.table, self.in_python = watch, transfers, segment_table(setup), in_python
        self.setup, self.equation, self.made, self.samples = setup, equation, made, samples
        self.on_progress, self.observer, self.compiled = on_progress, observer, machine_code is not None
        n, m = equation.plant.dynamics.n, equation.size
        held = n if equation.sampled else 0
        self.start = equation.start(setup.q0, setup.v0)
        self.stepper, self.control = _method(setup, equation)
        self.functions, parameters = made(equation)
        run_parameters = np.concatenate([np.full(held, np.nan), parameters])[:, None]
        self.bodies = self.functions.bodies
        modes = None
        if equation.impulses:
            modes = modes_of(equation, run_parameters.copy(), places, _ACCUMULATED, _BRIEF * setup.duration_s)
            modes.start(self.start)
        alone = thresholds and modes is None and not transfers.any
        self.switching = cached(setup, _switching) if alone else Switching(equation, modes=modes)
        if not thresholds:
            self.switching = Switching(equation, self.switching.quantities, modes)
        self.runs = runs_of(equation, self.start[:, None], run_parameters, m + n + 2)
        self.runs.energy[0], self.runs.scale[0] = self.watch.energy, self.watch.scale
        of = self.stepper
        self.advance = machine_code or event_loop(
            of.begin, of.step, of.error, of.accept, of.dense, without_modes if modes is None else end_mode
        )
        self.rules = cached(setup, rules_alone)
        self.times = _times(setup, mesh, samples)
        compared = self.times.compared
        S, rows = len(self.table.counts), int(most_samples(setup)) + 2 if samples else 0
        states = 0 if compared == inf else _COMPARED + S + 2
        shown = (np.empty((1 + 3 * n, 0)), NOTHING) if observer is None else (observer.columns, observer.observation)
        self.kept = Kept(
            np.empty(rows), np.empty((rows, m, 1)), np.empty((rows, m + n + 2, 1)), np.empty(states),
            np.empty((states, m)), np.empty(_CHUNK), np.empty((_CHUNK, m)), *shown,
        )  # fmt: skip
        events, degree = self.functions.events if self.compiled else self.switching.function, len(of.work.F)
        if alone and not setup.events:
            known = copied(cached(setup, _switches))
            self.switches = known._replace(functions=events, b=np.zeros(degree + 1), stack=room(degree))
        else:
            self.switches = self.switching.at(0.0, self.start, degree, events, run_parameters[:n, 0] if held else None)
        self.events: list[Occurrence] = []
        self.log = event_log(n, 0, _BRIEF * setup.duration_s) if modes is None else modes.holding.log
        self._forget_sides()
        self._change_mode()
        self.now, self.stop = np.zeros(len(Now), np.int64), np.zeros(1, np.int64)

    @property
    def time(self) -> float:
        """The time reached, in [s]."""
        return float(self.times.reached[0])

    def record(self) -> Recording:
        """Run to the end, however the run ends."""
        try:
            with np.errstate(all="ignore"):  # what overflows ends the run
                self._loop()
            outcome = Outcome(Ending.FINISHED, self.setup.duration_s)
        except TerminalEvent as end:
            outcome = Outcome(Ending.FINISHED, end.t, f"ended by the event {str(end)!r}")
            self._keep_end(end.t)
        except DivergedError as end:
            outcome = Outcome(Ending.DIVERGED, end.t, str(end))
        except KeyboardInterrupt:
            outcome = Outcome(Ending.STOPPED, self.time, "interrupted; all samples up to here are kept")
        return self._record(outcome)

    def _room(self, budget: int) -> int:
        self._widen()
        rest = len(self.kept.step_log_t) - int(self.now[Now.WALKED]) or budget
        if self._look:
            rest = min(rest, self._until_look())
        return min(rest, super()._room(budget))

    def _until_look(self) -> int:
        """Steps until it is looked whether another method is to make the run; StiffError if one is."""
        steps = int(self.now[Now.STEPS])
        if steps >= self._look:
            self._look *= 2
            held = self.runs.run_parameters[: self.rules.held, 0] if self.rules.held else None
            ends = self.kept.step_log_t[: int(self.now[Now.WALKED])]
            changes_over(self.setup, self.switching.on(self.switches.sides), ends, self.y, held)
        return self._look - steps

    def _widen(self) -> None:
        """Room for as many more ends of steps, where it is used up."""
        kept, rows = self.kept, len(self.kept.step_log_t)
        if self.now[Now.WALKED] == rows:
            states = max(len(kept.step_log), min(2 * rows, MOST_SHARED))
            wider = np.empty(2 * rows), np.empty((states, self.equation.size))
            wider[0][:rows], wider[1][: len(kept.step_log)] = kept.step_log_t, kept.step_log
            self.kept = kept._replace(step_log_t=wider[0], step_log=wider[1])

    def _advance(self) -> Ended:
        arguments = self.functions, self.table, self.runs, self.kept, self.times, self.rules
        modes = self.switching.modes
        holding = NOTHING_HELD if modes is None else modes.holding
        made = self.stepper.coefficients, self.stepper.work, self.switches, self.sides, holding
        try:
            return Ended(self.advance(*arguments, *made, self.now, self.control, self.stop))
        except RobotDynError as error:
            if is_mistake(error):
                raise
            if not self.setup.integrator.controls_error:
                self._step_in_words()
            raise DivergedError(self.time, f"{error}, at t = {self.time}") from None
        finally:
            self._tell()

    def _step_in_words(self) -> None:
        """A step of a method of fixed step that was not found: DivergedError with the words for it."""
        s, t, y = int(self.now[Now.SEGMENT]), self.time, self.y
        equation = self.switching.on(self.switches.sides)
        p, functions = self.table.parameters[s], interpreted(equation, self.watch)
        right_side = system(functions, equation, p, self.runs.run_parameters[: self.rules.held])
        h = float(self.control[At.TAKEN])
        one_step(self.setup.integrator, right_side, t, y, h, self.watch)
        raise self.watch.diverged(t, y, "a number overflowed")

    def _judge(self, ended: Ended) -> None:
        """What the loop came back for; DivergedError ends the run, TooLongError gives it up."""
        if self.now[Now.EVALUATIONS] > self.most:
            raise TooLongError(int(self.now[Now.EVALUATIONS]))
        t, y = self.time, self.y
        if t > self.beyond + self.setup.duration_s / _COMPARED:
            raise TerminalEvent(self.beyond, "of the run")
        self.watch.pace(t, y, int(self.now[Now.STEPS]))
        where = f"at t = {t}, max |y| = {np.abs(y).max():.3g}: y grows without bound, or tolerances are too tight"
        if ended is Ended.EVENT:
            self._event(t, y)
        elif ended in (Ended.CHANGED, Ended.ACCUMULATED, Ended.UNSETTLED):
            self._end_mode(ended, t, y)
        elif ended is Ended.TRANSFER:
            self._transfer(int(self.now[Now.SEGMENT]))
        elif ended is Ended.TICK:
            s = int(self.now[Now.SEGMENT])
            y, held = self.watch.tick(float(self.table.starts[s]), y)
            self.runs.y[:, 0], self.runs.run_parameters[: self.rules.held, 0] = y, held
            self.table.ticks[s] = 0
        elif ended is Ended.GAINS:
            self.watch.look(t, y)
        elif ended is Ended.TOO_SMALL and not self.setup.integrator.controls_error:
            self._step_in_words()
        elif self.met is not None and ended in (Ended.TOO_SMALL, Ended.NOT_FINITE):
            raise DivergedError(t, f"{self.met}, at t = {t}")
        elif ended is Ended.TOO_SMALL:
            raise DivergedError(t, f"the step became smaller than the spacing of floats {where}")
        elif ended is Ended.NOT_FINITE:
            raise DivergedError(t, f"the rate is not finite {where}")
        elif ended is Ended.FAST:
            raise DivergedError(t, "a joint moves faster than 1e+06 rad/s: the control is unstable")

    def _keep_end(self, t: float) -> None:
        """A sample where an event ends the run."""
        row, s = int(self.now[Now.ROW]), int(self.now[Now.SEGMENT])
        if self.samples and not (row and self.kept.t[row - 1] == t):
            functions = self.in_python or self.functions
            self.kept.t[row], self.kept.y[row] = t, self.runs.y
            functions.sample(t, self.runs.y, self.table.parameters[s], self.runs.run_parameters, self.kept.made[row])
            self.now[Now.ROW] += 1

    def _record(self, outcome: Outcome) -> Recording:
        kept = self.kept
        rows, shared, step_log = (int(self.now[i]) for i in (Now.ROW, Now.SHARED, Now.WALKED))
        if self.samples and not rows:  # interrupted, or without a tick, at once
            kept.t[0], kept.y[0, :, 0], kept.made[0], rows = 0.0, self.start, np.nan, 1
        ends = kept.step_log_t[:step_log]
        states = np.vstack([self.start, kept.step_log[: min(step_log, len(kept.step_log))]])
        path = Path(np.full(len(states), -1), np.append(0.0, ends)[: len(states)], states)
        if self.setup.integrator.controls_error:
            common = Path(np.arange(shared), kept.shared_t[:shared], kept.shared[:shared])
        else:
            common = _on(nodes(self.setup.segments), path)
        return Recording(
            outcome, kept.t[:rows], kept.y[:rows, :, 0], kept.made[:rows, :, 0], common, path,
            int(self.now[Now.STEPS]), int(self.now[Now.EVALUATIONS]), float(self.runs.peak[0]), tuple(self.events),
            ends,
        )  # fmt: skip


def _switching(setup: Setup) -> Switching:
    """Where the equation of a setup switches, in which nothing is held or carried."""
    return Switching(setup.equation)


def _switches(setup: Setup) -> Switches:
    """Its switching functions at the start, if no event is asked for."""
    equation = setup.equation
    held = np.full(equation.plant.dynamics.n, np.nan) if equation.sampled else None
    return cached(setup, _switching).at(0.0, equation.start(setup.q0, setup.v0), 0, None, held)


def _method(setup: Setup, equation: StateEquation) -> tuple[ControlledStepper, np.ndarray]:
    """The method made ready, and the choice of its steps before the first."""
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
