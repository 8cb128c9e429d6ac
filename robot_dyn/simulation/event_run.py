"""A run whose steps are chosen or cut, followed by Python: the loop comes back for progress, Ctrl-C and events.

At an event the effects change their mode: what they are on the other side of a switch stands in their coefficients, so
that within a step the right-hand side is smooth.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import Any, final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.errors import NotFiniteError, OverflowedError, RobotDynError
from robot_dyn.foreign import is_mistake
from robot_dyn.integrate import hermite
from robot_dyn.integrate.adaptive import STEPPERS
from robot_dyn.integrate.bernstein import room
from robot_dyn.integrate.step_control import At, ControlledStepper, control_of
from robot_dyn.simulation.crossings import Switches
from robot_dyn.simulation.event import Occurrence
from robot_dyn.simulation.event_loop import Kept, Times, event_loop
from robot_dyn.simulation.fixed_step import rules_alone, runs_of
from robot_dyn.simulation.followed import Followed
from robot_dyn.simulation.modes import Guard
from robot_dyn.simulation.observation import NOTHING
from robot_dyn.simulation.observer import Observer
from robot_dyn.simulation.plan import plan_of
from robot_dyn.simulation.record import MOST_SHARED, Path, Record
from robot_dyn.simulation.remarks import Kind, Remark
from robot_dyn.simulation.schedule import nodes
from robot_dyn.simulation.setup import STEP_S, Setup
from robot_dyn.simulation.size import samples as most_samples
from robot_dyn.simulation.state_equation import StateEquation
from robot_dyn.simulation.state_functions import interpreted, system
from robot_dyn.simulation.stiffness import FIRST_LOOK, changes_over
from robot_dyn.simulation.switching import Switching
from robot_dyn.simulation.time_loop import Ended, Functions, Now
from robot_dyn.simulation.trajectory import Ending, Outcome
from robot_dyn.simulation.transfers import Transfers
from robot_dyn.simulation.watch import DivergedError, Watch, one_step
from robot_dyn.threshold import Threshold
from robot_dyn.values import copied

_SAMPLES = 1000  # of a run without a record period
_COMPARED = 1000  # times at which a run is compared with runs of other tolerances
_CHATTER, _BRIEF = 20, 1e-9  # events of one threshold, in that part of the run
_ACCUMULATED = 1000  # changes of the mode, in that part of the run: no motion that ends them is left between
_CHUNK = 1024  # ends of steps for which there is room at first

Advance = Callable[..., int]
Made = Callable[[StateEquation], tuple[Functions, np.ndarray]]


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


class AccumulationError(Exception):
    """Internal: a run whose events accumulate, which time stepping is to make.

    Attributes:
        remark: Why.
    """

    def __init__(self, remark: Remark) -> None:
        super().__init__(remark.text)
        self.remark = remark


class TerminalEvent(Exception):  # noqa: N818
    """Internal: an event that ends the run, at `t`."""

    def __init__(self, t: float, name: str) -> None:
        super().__init__(name)
        self.t = t


@final
class EventRun(Followed):
    """A run on its way.

    Args:
        watch: Of the setup, and its state equation.
        transfers: What it carries.
        made: Gives the functions of a state equation, for the loop, and their parameters (P,).
        mesh: Where steps end, (k,), before error control ends them; None for error control alone.
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
        self, watch: Watch, transfers: Transfers, made: Made, mesh: np.ndarray | None,
        machine_code: Advance | None = None,
        on_progress: Callable[[float], object] | None = None, observer: Observer | None = None,
        in_python: Functions | None = None, samples: bool = True, most: float = inf,
        thresholds: bool = True, chooses: bool = False,
    ) -> None:  # fmt: skip
        setup, equation, self.most, self._look = watch.setup, watch.equation, most, FIRST_LOOK if chooses else 0
        self._chooses, self._changes = chooses, deque[float](maxlen=_ACCUMULATED)  # times of changes of the mode
        self.watch, self.transfers, self.plan, self.in_python = watch, transfers, plan_of(setup), in_python
        self.setup, self.equation, self.made, self.samples = setup, equation, made, samples
        self.on_progress, self.observer, self.compiled = on_progress, observer, machine_code is not None
        n, m = equation.plant.dynamics.n, equation.size
        held = n if equation.sampled else 0
        self.start = equation.start(setup.q0, setup.v0)
        self.stepper, self.control = _method(setup, equation)
        alone = thresholds and not (equation.impulses or transfers.any)
        self.switching = setup.kept(_switching) if alone else Switching(equation)
        if not thresholds:
            self.switching = Switching(equation, self.switching.quantities)
        self.functions, parameters = made(equation)
        own = np.concatenate([np.full(held, np.nan), parameters])[:, None]
        self.runs = runs_of(equation, self.start[:, None], own, m + n + 2)
        self.runs.energy[0], self.runs.scale[0] = self.watch.energy, self.watch.scale
        of = self.stepper
        self.advance = machine_code or event_loop(of.begin, of.step, of.error, of.accept, of.dense)
        self.rules = setup.kept(rules_alone)
        self.times = _times(setup, mesh, samples)
        compared = self.times.compared
        S, rows = len(self.plan.counts), int(most_samples(setup)) + 2 if samples else 0
        states = 0 if compared == inf else _COMPARED + S + 2
        shown = (np.empty((1 + 3 * n, 0)), NOTHING) if observer is None else (observer.columns, observer.observation)
        self.kept = Kept(
            np.empty(rows), np.empty((rows, m, 1)), np.empty((rows, m + n + 2, 1)), np.empty(states),
            np.empty((states, m)), np.empty(_CHUNK), np.empty((_CHUNK, m)), *shown,
        )  # fmt: skip
        if self.switching.modes is not None:
            self.switching.modes.start(self.start)
        events, degree = self.functions.events if self.compiled else self.switching.function, len(of.work.F)
        if alone and not setup.events:
            known = copied(setup.kept(_switches))
            self.switches = known._replace(functions=events, b=np.zeros(degree + 1), stack=room(degree))
        else:
            self.switches = self.switching.at(0.0, self.start, degree, events, own[:n, 0] if held else None)
        self.events: list[Occurrence] = []
        self.beyond = inf
        self.met: RobotDynError | None = None
        self._change_mode()
        self.now, self.stop = np.zeros(len(Now), np.int64), np.zeros(1, np.int64)

    @property
    def time(self) -> float:
        """The time reached, in [s]."""
        return float(self.times.reached[0])

    @property
    def y(self) -> np.ndarray:
        """The state reached."""
        return self.runs.y[:, 0].copy()

    def record(self) -> Record:
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
        rest = len(self.kept.walked_t) - int(self.now[Now.WALKED]) or budget
        if self._look:
            rest = min(rest, self._until_look())
        return min(rest, super()._room(budget))

    def _until_look(self) -> int:
        """Steps until it is looked whether another method is to make the run; StiffError if one is."""
        steps = int(self.now[Now.STEPS])
        if steps >= self._look:
            self._look *= 2
            held = self.runs.own[: self.rules.held, 0] if self.rules.held else None
            ends = self.kept.walked_t[: int(self.now[Now.WALKED])]
            changes_over(self.setup, self.switching.on(self.switches.sides), ends, self.y, held)
        return self._look - steps

    def _widen(self) -> None:
        """Room for as many more ends of steps, where it is used up."""
        kept, rows = self.kept, len(self.kept.walked_t)
        if self.now[Now.WALKED] == rows:
            states = max(len(kept.walked), min(2 * rows, MOST_SHARED))
            wider = np.empty(2 * rows), np.empty((states, self.equation.size))
            wider[0][:rows], wider[1][: len(kept.walked)] = kept.walked_t, kept.walked
            self.kept = kept._replace(walked_t=wider[0], walked=wider[1])

    def _advance(self) -> Ended:
        arguments = self.functions, self.plan, self.runs, self.kept, self.times, self.rules
        made = self.stepper.coefficients, self.stepper.work, self.switches
        try:
            return Ended(self.advance(*arguments, *made, self.now, self.control, self.stop))
        except RobotDynError as error:
            if is_mistake(error):
                raise
            if not self.setup.integrator.controls_error:
                self._step_in_words()
            raise DivergedError(self.time, f"{error}, at t = {self.time}") from None

    def _step_in_words(self) -> None:
        """A step of a method of fixed step that was not found: DivergedError with the words for it."""
        s, t, y = int(self.now[Now.SEGMENT]), self.time, self.y
        equation = self.switching.on(self.switches.sides)
        p, functions = self.plan.parameters[s], interpreted(equation, self.watch)
        right_side = system(functions, equation, p, self.runs.own[: self.rules.held])
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
        elif ended is Ended.TRANSFER:
            self._transfer(int(self.now[Now.SEGMENT]), y)
        elif ended is Ended.TICK:
            s = int(self.now[Now.SEGMENT])
            y, held = self.watch.tick(float(self.plan.starts[s]), y)
            self.runs.y[:, 0], self.runs.own[: self.rules.held, 0] = y, held
            self.plan.ticks[s] = 0
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
            functions.sample(t, self.runs.y, self.plan.parameters[s], self.runs.own, self.kept.made[row])
            self.now[Now.ROW] += 1

    def _change_mode(self) -> None:
        """Let the functions be those of the sides that the switching functions are on."""
        switching = self.switching
        if switching.thresholds or switching.dropped or switching.modes is not None or self.transfers.any:
            self.functions, parameters = self.made(switching.on(self.switches.sides))
            self.runs.own[self.rules.held :, 0] = parameters
        if not self.compiled:
            self.functions = self._lenient(self.functions)

    def _lenient(self, functions: Functions) -> Functions:
        """The functions in Python, with a rate that is nan where a trial step goes too far: a shorter one is tried."""

        def rate(t: float, y: Array, p: Array, own: Array, out: Array) -> None:
            try:
                functions.rate(t, y, p, own, out)
            except (OverflowedError, NotFiniteError) as error:
                self.met, out[...] = error, np.nan

        made: Any = functions._replace(rate=rate)
        return made

    def _chatters(self) -> bool:
        """Whether the latest events were all of one threshold, in next to no time."""
        latest = self.events[-_CHATTER:]
        brief = latest[-1].t - latest[0].t <= _BRIEF * self.setup.duration_s
        return len(latest) == _CHATTER and brief and len({each.joint for each in latest} - {""}) == 1

    def _drop(self, each: Threshold) -> None:
        """Look for the thresholds of a joint no longer, where steps would never get on."""
        last = self.events[-1]
        self.events.append(replace(last, name=f"{last.name} chatters, and is no longer looked for"))
        dropped = self.switching.dropped | {(each.joint, each.of_actuation)}
        self.switching = Switching(self.equation, dropped, self.switching.modes)
        held = self.runs.own[: self.rules.held, 0] if self.rules.held else None
        self._watch_anew(last.t, held)

    def _end_mode(self, t: float, y: np.ndarray, guard: Guard) -> None:
        """Go on in another mode, from the state behind the event."""
        modes, held = self.switching.modes, self.runs.own[: self.rules.held, 0] if self.rules.held else None
        assert modes is not None
        self.runs.y[:, 0], happened = modes.after(t, y, held, guard)
        self.events = sorted([*self.events, *happened], key=lambda each: each.t)
        self._changes.append(t)
        if len(self._changes) == _ACCUMULATED and t - self._changes[0] <= _BRIEF * self.setup.duration_s:
            self._accumulated(t, y, self.equation.plant.dynamics.joint_names[modes.joint(guard.joint)])
        self._watch_anew(t, held)
        if self.setup.integrator.needs_jacobian:
            self.control[At.NEXT] = 0.0
        self._change_mode()

    def _transfer(self, s: int, y: np.ndarray) -> None:
        """Go on with what is carried from the start of a segment on."""
        t, held = float(self.plan.starts[s]), self.runs.own[: self.rules.held, 0] if self.rules.held else None
        y, happened = self.transfers.over(t, y)
        self.equation = self.watch.equation = self.transfers.equation
        self.switching = self.switching.of(self.equation)
        if (modes := self.switching.modes) is not None:
            modes.of.part(y)
            y, more = modes.after(t, y, held, None)
            happened += more
        self.runs.y[:, 0] = y
        self.events += happened
        self.plan.transfers[s] = 0
        self._watch_anew(t, held)
        if self.setup.integrator.needs_jacobian:
            self.control[At.NEXT] = 0.0
        self._change_mode()

    def _accumulated(self, t: float, y: np.ndarray, joint: str) -> None:
        """AccumulationError if another method may make the run, else DivergedError."""
        first = self._changes[0]
        what = f"{_ACCUMULATED} changes of what holds joints in {t - first:.1e} s, the last of joint {joint!r}"
        motion = self.equation.equation_of_motion
        alone = motion.payloads or motion.drives  # which time stepping does not take
        if alone or not self._chooses:
            remedy = "soft stops and regularised friction" if alone else "integrator='time_stepping' and a step_s"
            raise DivergedError(t, f"events accumulate at t = {t}: {what}; take {remedy}")
        velocity = float(np.abs(y[self.rules.n : 2 * self.rules.n]).max())
        remedy = f"made by time stepping with steps of {STEP_S} s, without an estimate of its error"
        raise AccumulationError(
            Remark(
                Kind.ACCUMULATE, joint, "v", first, t - first, t, velocity, None, f"{what}, at t = {t:.6g} s", remedy
            )
        )

    def _watch_anew(self, t: float, held: Array | None) -> None:
        """The switching functions of the state reached."""
        degree, functions = len(self.switches.b) - 1, self.switches.functions
        self.switches = self.switching.at(t, self.y, degree, functions, held)

    def _event(self, t: float, y: np.ndarray) -> None:
        """Keep an event, and go on behind it; TerminalEvent ends the run."""
        index, E = int(self.now[Now.EVENT]), len(self.switching.thresholds)
        side = float(self.switches.sides[index])
        index, guard = self.switching.place(index)
        if guard is not None:
            self._end_mode(t, y, guard)
            return
        if index < E:
            self.events.append(self.switching.occurrence(index, t, y, side))
            if self.setup.integrator.needs_jacobian:
                self.control[At.NEXT] = 0.0  # an L-stable step damps what is fast: to start with, it must be resolved
            if self._chatters():
                self._drop(self.switching.thresholds[index])
            self._change_mode()
            return
        event = self.setup.events[index - E]
        if event.direction in (0, int(side)):
            self.events.append(self.switching.occurrence(index, t, y, side))
            if event.terminal and self.samples:
                raise TerminalEvent(t, event.name)
            if event.terminal:  # a companion goes on, past the states of the run at which they are compared
                self.beyond = min(self.beyond, t)

    def _record(self, outcome: Outcome) -> Record:
        kept = self.kept
        rows, shared, walked = (int(self.now[i]) for i in (Now.ROW, Now.SHARED, Now.WALKED))
        if self.samples and not rows:  # interrupted, or without a tick, at once
            kept.t[0], kept.y[0, :, 0], kept.made[0], rows = 0.0, self.start, np.nan, 1
        ends = kept.walked_t[:walked]
        states = np.vstack([self.start, kept.walked[: min(walked, len(kept.walked))]])
        path = Path(np.full(len(states), -1), np.append(0.0, ends)[: len(states)], states)
        if self.setup.integrator.controls_error:
            common = Path(np.arange(shared), kept.shared_t[:shared], kept.shared[:shared])
        else:
            common = _on(nodes(self.setup.segments), path)
        return Record(
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
    return setup.kept(_switching).at(0.0, equation.start(setup.q0, setup.v0), 0, None, held)


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
