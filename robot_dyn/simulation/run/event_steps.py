"""Steps chosen by error control, or ended by events: calls of `event_loop`, and the work of Python between them.

At an event the effects change their mode: their coefficients choose the formula on the other side of a switch, so that
the right-hand side is smooth within a step.
"""

from __future__ import annotations

from math import inf
from typing import Any, ClassVar, NoReturn, cast, final

import numpy as np

from robot_dyn.foundations.errors import RobotDynError, is_mistake
from robot_dyn.foundations.values import cached
from robot_dyn.integrate import hermite
from robot_dyn.integrate.adaptive import STEPPERS
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.integrate.step_control import ControlledStepper, StepControl, initial_control
from robot_dyn.simulation.dynamics.loop_state import Ended, LoopConfig, loop_config
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.engine.interpreted import interpreted, system
from robot_dyn.simulation.events.mode_change import end_mode, without_modes
from robot_dyn.simulation.run.event_handler import EventHandler
from robot_dyn.simulation.run.event_loop import event_loop
from robot_dyn.simulation.run.outcome import GivesUp, Outcome, Reason, Stiff, TooLong
from robot_dyn.simulation.run.recording import MOST_SHARED, Path, sample
from robot_dyn.simulation.run.state import RunState
from robot_dyn.simulation.run.stiffness import FIRST_LOOK, changes_over
from robot_dyn.simulation.run.watch import DivergedError, one_step
from robot_dyn.simulation.setup.schedule import nodes
from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.simulation.setup.setup import samples as most_samples

_SAMPLES = 1000  # number of samples without a record period
_COMPARED = 1000  # times at which a run is compared with runs of other tolerances
_CHUNK = 1024  # ends of steps that are allocated at first


@final
class EventSteps:
    """Steps of a run that are chosen, or end at events.

    Args:
        state: The state of the run.
        mesh: Times at which steps end, (k,), in [s]; None for error control alone.
        samples: True to record samples; False for a companion run, which passes terminal events.
        max_evaluations: Evaluations after which the run gives up as `TooLong`.
        thresholds: True to find the thresholds of effects; otherwise the effects switch within steps.
        may_replace: True to give up as `Stiff` or `Accumulation` where another method is better suited.

    Attributes:
        first_budget: Steps of machine code before its speed is measured.
    """

    first_budget: ClassVar[int] = 200

    def __init__(
        self,
        state: RunState,
        mesh: np.ndarray | None,
        *,
        samples: bool,
        max_evaluations: float,
        thresholds: bool,
        may_replace: bool,
    ) -> None:
        setup = state.setup
        self.state, self.samples, self.max_evaluations = state, samples, max_evaluations
        self.past_horizon = inf  # time of the first terminal event that a companion passed, in [s]
        self._next_look = FIRST_LOOK if may_replace else 0  # number of steps at which stiffness is checked; 0 for never
        self.stepper, self.control = _stepper(setup, state.equation, mesh)
        config = cached(setup, event_config)
        if not samples:
            config = config._replace(sample_period=inf, samples_nodes=False, samples_steps=False)
        shared = 0 if config.share_period == inf else _COMPARED + len(state.table.counts) + 2
        state.allocate(config, int(most_samples(setup)) + 2 if samples else 0, shared, _CHUNK)
        self.handler = EventHandler(state, self.control, len(self.stepper.work.F), thresholds, may_replace)
        method, ends = self.stepper, without_modes if self.handler.switching.contacts is None else end_mode
        self.loop = state.engine.loop() or event_loop(
            method.begin, method.step, method.error, method.accept, method.dense, ends
        )

    @property
    def time(self) -> float:
        """The time reached, in [s]."""
        return float(self.state.position.time[0])

    def room(self, budget: int) -> int:
        """Return the number of steps before the loop must return: the log of steps is full, or stiffness is checked."""
        self._widen()
        room = len(self.state.records.step_log_t) - int(self.state.position.step_row[0]) or budget
        return min(room, self._next_look - int(self.state.position.steps[0])) if self._next_look else room

    def detect_stiffness(self) -> Stiff | None:
        """Return `Stiff` if a stiff method should replace the run, else None."""
        state = self.state
        if not self._next_look or state.position.steps[0] < self._next_look:
            return None
        self._next_look *= 2
        ends = state.records.step_log_t[: int(state.position.step_row[0])]
        return changes_over(state.setup, self._equation, ends, state.y, state.held)

    def advance(self) -> Ended:
        """Call the loop until it returns."""
        state, stepper = self.state, self.stepper
        arguments = state.functions, stepper.coefficients, stepper.work, state.loop, self.handler.events
        try:
            return Ended(self.loop(*arguments, self.control, state.stop))
        except RobotDynError as error:
            if is_mistake(error):
                raise
            if not state.setup.method.controls_error:
                self._review_step()
            raise DivergedError(Outcome(Reason.CANNOT_EVALUATE, self.time, facts={"error": str(error)})) from None
        finally:
            self.handler.take_log()

    def judge(self, ended: Ended) -> Outcome | GivesUp | None:
        """Handle the reason for which the loop returned; return the end of the run, or None, or raise DivergedError."""
        state, handler, t, y = self.state, self.handler, self.time, self.state.y
        if state.position.evaluations[0] > self.max_evaluations:
            return TooLong(int(state.position.evaluations[0]))
        if not t <= state.setup.duration_s * (1 + 1e-9):  # time of an event in states that overflow
            samples = state.records.t[: int(state.position.sample_row[0])]
            times = [0.0, *samples, *(event.t for event in state.events)]
            t = float(max(time for time in times if time <= state.setup.duration_s))
            if not state.setup.method.controls_error:
                raise state.watch.diverged(Reason.STATE_OVERFLOWS, t, y)
            raise DivergedError(Outcome(Reason.STATE_OVERFLOWS, t, facts={"largest": inf}))
        if t > self.past_horizon + state.setup.duration_s / _COMPARED:
            return Outcome(Reason.END, self.past_horizon)
        state.watch.check_pace(t, y, int(state.position.steps[0]))
        if ended is Ended.EVENT:
            return self._event(t, y)
        if ended in (Ended.CHANGED, Ended.ACCUMULATED, Ended.UNSETTLED):
            return handler.after_mode(ended, t, y)
        if ended is Ended.PAYLOAD:
            handler.change_payload()
        elif ended is Ended.TICK:
            state.tick()
        elif ended is Ended.ENERGY_GROWS:
            state.watch.check_energy(t, y)
        elif ended is Ended.TOO_SMALL and not state.setup.method.controls_error:
            self._review_step()
        elif ended is not Ended.PAUSED:
            raise DivergedError(self._failure(ended, t, y))
        return None

    def _failure(self, ended: Ended, t: float, y: np.ndarray) -> Outcome:
        """Return the outcome if error control has failed to take a step."""
        if ended is Ended.FAST:
            joint = self.state.equation.fastest_joint(y)
            return Outcome(Reason.IMPLAUSIBLE_SPEED, t, joint, facts={"limit": 1e6})
        if (error := self.handler.error) is not None:
            return Outcome(Reason.CANNOT_EVALUATE, t, facts={"error": str(error)})
        reason = Reason.RATE_NOT_FINITE if ended is Ended.NOT_FINITE else Reason.STEP_BELOW_FLOAT_SPACING
        return Outcome(reason, t, facts={"largest": float(np.abs(y).max())})

    def _event(self, t: float, y: np.ndarray) -> Outcome | None:
        """Handle an event; return the outcome if it ends the run."""
        name = self.handler.event(t, y)
        if name is None:
            return None
        if not self.samples:  # a companion continues past the states that are compared
            self.past_horizon = min(self.past_horizon, t)
            return None
        state, row = self.state, int(self.state.position.sample_row[0])
        if not (row and state.records.t[row - 1] == t):
            sample(state.in_python, state.loop, t, state.lanes.y, state.table.parameters[state.segment])
        return Outcome(Reason.TERMINAL_EVENT, t, facts={"event": name})

    @property
    def _equation(self) -> StateEquation:
        """The state equation on the current sides of the switching functions."""
        return self.handler.switching.on(self.handler.event_table.sides)

    def _review_step(self) -> NoReturn:
        """Repeat a failed step of a method of fixed step by the interpreted equation; DivergedError has the reason."""
        state, t, y, equation = self.state, self.time, self.state.y, self._equation
        p, functions = state.table.parameters[state.segment], interpreted(equation, state.watch)
        right_side = system(functions, equation, p, state.lanes.run_parameters[: state.config.held])
        one_step(cast(Integrator, state.setup.method), right_side, t, y, float(self.control.h[0]), state.watch)
        raise state.watch.diverged(Reason.STATE_OVERFLOWS, t, y)

    def _widen(self) -> None:
        """Double the log of steps if it is full."""
        records, rows = self.state.records, len(self.state.records.step_log_t)
        if self.state.position.step_row[0] == rows:
            states = max(len(records.step_log), min(2 * rows, MOST_SHARED))
            t, y = np.empty(2 * rows), np.empty((states, len(self.state.start)))
            t[:rows], y[: len(records.step_log)] = records.step_log_t, records.step_log
            self.state.loop = self.state.loop._replace(records=records._replace(step_log_t=t, step_log=y))

    def paths(self) -> tuple[Path, Path, np.ndarray]:
        """Return the states shared with companions; those at the ends of steps; and the times of all ends of steps.

        The second has at most about `MOST_SHARED` states, the first ones.
        """
        records, setup, position = self.state.records, self.state.setup, self.state.position
        shared, steps = int(position.shared_row[0]), int(position.step_row[0])
        ends = records.step_log_t[:steps]
        states = np.vstack([self.state.start, records.step_log[: min(steps, len(records.step_log))]])
        path = Path(np.full(len(states), -1), np.append(0.0, ends)[: len(states)], states)
        if not setup.method.controls_error:
            return _on(nodes(setup.segments), path), path, ends
        return Path(np.arange(shared), records.shared_t[:shared], records.shared[:shared]), path, ends


def _on(times: np.ndarray, path: Path) -> Path:
    """Return the states of a path that lie on nodes; their keys are the numbers of steps before these."""
    key = np.minimum(np.searchsorted(times, path.t), len(times) - 1)
    rows = np.flatnonzero((times[key] == path.t) & np.append(np.diff(path.t) > 0, True))
    return Path(key[rows], path.t[rows], path.y[rows])


def _stepper(setup: Setup, equation: StateEquation, mesh: np.ndarray | None) -> tuple[ControlledStepper, StepControl]:
    """Return the stepper of the method, and the control of its steps before the first."""
    method: Any = setup.method
    n, m, ends = equation.plant.dynamics.n, equation.size, np.zeros(0) if mesh is None else mesh
    if not method.controls_error:
        stepper = hermite.stepper(method, m, n, m + n, equation.widths)
        return stepper, initial_control(stepper.error_order, mesh=ends)
    controlled = m - len(equation.sources)  # entries of y whose error is controlled: all but the works
    stepper = STEPPERS[method.method](m, m + n, controlled)
    constant = equation.state_size if equation.sampled else 0  # between ticks, so that their error is 0
    part = np.sqrt(1 - constant / controlled)  # the tolerances are for the mean of squares over the other entries
    longest = min(method.max_step_s, setup.longest_step_s)
    return stepper, initial_control(stepper.error_order, part * method.rtol, part * method.atol, longest, ends)


def event_config(setup: Setup) -> LoopConfig:
    """Return the settings of the loop, with the periods of samples and of states shared with companions."""
    controls_error, at_nodes = setup.method.controls_error, not setup.record_every_s
    period = setup.record_every_s or (setup.duration_s / _SAMPLES if controls_error else inf)
    share_period = setup.duration_s / _COMPARED if controls_error and setup.estimate_error else inf
    return loop_config(setup.equation, alone=True)._replace(
        sample_period=float(period),
        share_period=float(share_period),
        samples_nodes=at_nodes,
        samples_steps=at_nodes and not controls_error,
        duration=float(setup.duration_s),
        restarts=setup.method.needs_jacobian,
    )
