"""Events in Python: new modes and regions, payloads, and events that end a run, which the event loop leaves to it."""

from __future__ import annotations

from dataclasses import replace
from typing import final

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.convex import not_found
from robot_dyn.foundations.errors import NotFiniteError, OverflowedError, RobotDynError
from robot_dyn.foundations.threshold import Threshold
from robot_dyn.foundations.values import cached, copied
from robot_dyn.integrate.bernstein import work_array
from robot_dyn.integrate.primitives import evaluate
from robot_dyn.integrate.step_control import StepControl
from robot_dyn.simulation.dynamics.event import Occurrence
from robot_dyn.simulation.dynamics.loop_state import Ended, Functions
from robot_dyn.simulation.events.contact_mode import ContactMode, keep_motor_speeds, write_mode
from robot_dyn.simulation.events.contacts import NO_CONTACT, Contacts, contacts_of
from robot_dyn.simulation.events.event_log import CHATTER, EventKind, event_log, log_time
from robot_dyn.simulation.events.event_table import EventTable
from robot_dyn.simulation.events.mode_change import change_mode, start_mode
from robot_dyn.simulation.events.regions import add_region, empty_regions
from robot_dyn.simulation.events.switching import Switching
from robot_dyn.simulation.run.event_loop import Events
from robot_dyn.simulation.run.outcome import Accumulation, Outcome, Reason
from robot_dyn.simulation.run.state import RunState
from robot_dyn.simulation.run.watch import DivergedError
from robot_dyn.simulation.setup.setup import Setup

_BRIEF = 1e-9  # part of a run: events of one joint within it chatter
_MOST_CHANGES = 1000  # changes of mode within the fraction _BRIEF of a run; no motion between them is resolved


@final
class EventHandler:
    """The switching functions of a run, and the changes of its equation and state at events.

    Args:
        state: The state of the run.
        control: Control of the steps; it chooses a new first step if the equation changes.
        degree: Degree of the dense output.
        thresholds: True to find the thresholds of effects; otherwise the effects switch within steps.
        may_replace: True to give up where events accumulate, instead of ending the run.

    Attributes:
        switching: The switching functions, and the contacts.
        event_table: The switching functions as arrays.
        events: The events as data of the loop.
        error: Error of the rate in the latest trial step that failed, or None.
    """

    def __init__(self, state: RunState, control: StepControl, degree: int, thresholds: bool, may_replace: bool) -> None:
        self.state, self.control, self.may_replace = state, control, may_replace
        self.error: RobotDynError | None = None
        setup, equation, contacts, brief = state.setup, state.equation, None, _BRIEF * state.setup.duration_s
        self._bodies, functions = state.functions.bodies, state.functions.events
        if equation.impulses:
            parameters = state.lanes.run_parameters.copy()
            contacts = contacts_of(equation, parameters, state.engine.places(), _MOST_CHANGES, brief)
            start_mode(contacts.mode, state.start[:, None].copy())
        is_usual = thresholds and contacts is None and not state.payloads.any
        self.switching = cached(setup, switching_of) if is_usual else Switching(equation, contacts=contacts)
        if not thresholds:
            self.switching = Switching(equation, self.switching.quantities, contacts)
        if is_usual and not setup.events:
            table, coefficients = copied(cached(setup, start_table_of)), np.zeros(degree + 1)
            self.event_table = table._replace(functions=functions, coefficients=coefficients, stack=work_array(degree))
        else:
            self.event_table = self.switching.at(0.0, state.start, degree, functions, state.held)
        self.log = event_log(state.config.n, 0, brief) if contacts is None else contacts.mode.log
        self._forget_regions()
        self._apply_mode()

    def take_log(self) -> None:
        """Move the events that the loop has logged to the events of the run."""
        count, self.log.filled[0] = int(self.log.filled[0]), 0
        if count:
            happened = [self._occurrence(row) for row in self.log.rows[:count].tolist()]
            self.state.events = sorted([*self.state.events, *happened], key=lambda event: event.t)

    def event(self, t: float, y: np.ndarray) -> str | None:
        """Handle an event in the state y; return the name of a terminal one, else None."""
        index, thresholds = int(self.state.position.event[0]), self.switching.thresholds
        side = float(self.event_table.sides[index])
        index = self.switching.number(index)
        if index < len(thresholds):
            self._add(self.switching.occurrence(index, t, y, side))
            if self.state.setup.method.needs_jacobian:
                self.control.next_h[0] = 0.0  # an L-stable step damps fast motions: a short first step resolves them
            if self._chatters():
                self._drop(thresholds[index])
            self._apply_mode()
            return None
        event = self.state.setup.events[index - len(thresholds)]
        if event.direction not in (0, int(side)):
            return None
        self._add(self.switching.occurrence(index, t, y, side))
        return event.name if event.terminal else None

    def after_mode(self, ended: Ended, t: float, y: np.ndarray) -> Accumulation | None:
        """Handle the end of a contact mode that the loop leaves to Python; DivergedError ends the run.

        Args:
            ended: UNSETTLED if no mode is found: the run ends. ACCUMULATED: the run gives up or ends. CHANGED if the
                side of a threshold has changed with the mode: the table and the equation are renewed.
            t: Time, in [s].
            y: State, (m,).

        Returns:
            `Accumulation` if the run gives up; None if it continues.
        """
        contacts = self.switching.contacts
        assert contacts is not None
        if ended is Ended.UNSETTLED:
            raise self._unsettled(t, contacts)
        if ended is Ended.ACCUMULATED:
            guard = int(self.state.position.event[0]) - self.event_table.thresholds
            return self._accumulated(t, y, contacts.mode, contacts.joint(guard))
        self._renew_table(t)
        self._apply_mode()
        return None

    def change_payload(self) -> None:
        """Pick up or drop payloads at the start of the segment, and compute the mode after that."""
        state, s = self.state, self.state.segment
        t = float(state.table.starts[s])
        self._add(*state.change_payload())
        self._bodies = state.functions.bodies
        if (contacts := self.switching.contacts) is not None:
            run_parameters = state.lanes.run_parameters.copy()
            run_parameters[: state.config.held] = np.nan
            contacts = Contacts(state.equation, contacts.mode._replace(run_parameters=run_parameters))
            self._settle(contacts, t, state.table.parameters[s])
        self.switching = Switching(state.equation, self.switching.dropped, contacts)
        self._forget_regions()
        self.take_log()
        self._renew_table(t)
        if state.setup.method.needs_jacobian:
            self.control.next_h[0] = 0.0
        self._apply_mode()

    def _add(self, *happened: Occurrence) -> None:
        """Add events that Python handles to those of the run, and to the log of the loop."""
        self.state.events += happened
        for event in happened:
            log_time(self.log, event.t)

    def _occurrence(self, row: list[float]) -> Occurrence:
        """Return the event of a row of the log, whose state has q and v only."""
        if self.switching.contacts is not None and row[2] != EventKind.PASSES:
            return self.switching.contacts.occurrence(row)
        t, number, _, side, _, *values = row
        y = np.zeros(self.state.equation.size)
        y[: len(values)] = values
        return self.switching.occurrence(int(number), t, y, side)

    def _apply_mode(self) -> None:
        """Set the functions and parameters for the current sides of the switching functions and the contact mode."""
        state, switching = self.state, self.switching
        if switching.thresholds or switching.dropped or state.payloads.any:
            on_sides = switching.on(self.event_table.sides)
            functions, state.in_python, parameters = state.engine.evaluated(on_sides, state.watch)
            state.functions = functions._replace(bodies=self._bodies)
            state.set_parameters(parameters)
            if state.engine.is_compiled:  # otherwise the functions change, not only their parameters
                add_region(self.regions, switching.of_thresholds(self.event_table.sides), parameters)
        contacts = switching.contacts
        self.events = Events(self.event_table, self.regions, NO_CONTACT if contacts is None else contacts.mode)
        if contacts is not None:
            write_mode(contacts.mode, state.lanes.run_parameters)
        if callable(state.functions.rate):
            state.functions = self._lenient(state.functions)

    def _forget_regions(self) -> None:
        """Clear the cached parameters of the regions between thresholds."""
        state, rules = self.state, [(event.direction, event.terminal) for event in self.state.setup.events]
        directions, terminal = np.array(rules, float).reshape(-1, 2).T
        count, parameters = len(self.switching.thresholds), len(state.lanes.run_parameters) - state.config.held
        self.regions = empty_regions(count, parameters, directions.copy(), terminal > 0, self.log)

    def _lenient(self, functions: Functions) -> Functions:
        """Return Python functions whose rate is nan if it overflows, so that error control tries a shorter step."""

        def rate(t: float, y: Array, p: Array, run_parameters: Array, out: Array) -> None:
            try:
                evaluate(functions.rate, t, y, p, run_parameters, out)
            except (OverflowedError, NotFiniteError) as error:
                self.error, out[...] = error, np.nan

        return functions._replace(rate=rate)

    def _chatters(self) -> bool:
        """Return True if the latest events were all of one joint, within a very short time."""
        latest = self.state.events[-CHATTER:]
        brief = latest[-1].t - latest[0].t <= self.log.brief
        return len(latest) == CHATTER and brief and len({event.joint for event in latest} - {""}) == 1

    def _drop(self, threshold: Threshold) -> None:
        """Ignore the thresholds of a joint from now on, because steps would not advance."""
        last = self.state.events[-1]
        self.state.events.append(replace(last, name=f"{last.name} chatters, and is ignored from now on"))
        dropped = self.switching.dropped | {(threshold.joint, threshold.of_actuation)}
        self.switching = Switching(self.state.equation, dropped, self.switching.contacts)
        self._forget_regions()
        self._renew_table(last.t)

    def _settle(self, contacts: Contacts, t: float, p: np.ndarray) -> None:
        """Change the mode after a jump of the state."""
        state = self.state
        keep_motor_speeds(contacts.mode.laws, state.lanes.y)
        state.lanes.p[:] = p
        with np.errstate(all="ignore"):
            solved = change_mode(state.in_python, t, state.lanes, contacts.mode, -1)
        if not solved:
            raise self._unsettled(t, contacts)

    def _accumulated(self, t: float, y: np.ndarray, mode: ContactMode, joint: str) -> Accumulation:
        """Return `Accumulation` if time stepping may continue the run; else raise DivergedError."""
        first = float(mode.changes[mode.change_count[0] % len(mode.changes)])
        span = float(np.ptp(mode.changes))  # a rejected step may have stored a later time
        motion = self.state.equation.equation_of_motion
        excludes_time_stepping = motion.payloads or motion.drives
        if excludes_time_stepping or not self.may_replace:
            soft, stepping = "soft stops and regularised friction", "method='MoreauJean' and a step_s"
            remedy = soft if excludes_time_stepping else stepping
            facts = {"changes": len(mode.changes), "span_s": span, "remedy": remedy}
            raise DivergedError(Outcome(Reason.EVENTS_ACCUMULATE, t, joint, facts))
        speed = float(np.abs(y[self.state.config.n : 2 * self.state.config.n]).max())
        return Accumulation(joint, first, t, speed, len(mode.changes), span)

    def _unsettled(self, t: float, contacts: Contacts) -> DivergedError:
        """Return the error that ends a run if the solver finds no solution of the contact problem."""
        work = contacts.mode.work
        error = not_found(work.M_all[:, : len(work.load)], work.load)
        return self.state.watch.diverged(Reason.CANNOT_EVALUATE, t, self.state.y, error=str(error))

    def _renew_table(self, t: float) -> None:
        """Compute the switching functions of the state reached."""
        degree, functions = len(self.event_table.coefficients) - 1, self.event_table.functions
        self.event_table = self.switching.at(t, self.state.y, degree, functions, self.state.held)


def switching_of(setup: Setup) -> Switching:
    """Return the switching functions of a setup without contacts and payloads."""
    return Switching(setup.equation)


def start_table_of(setup: Setup) -> EventTable:
    """Return the switching functions at the start, without user-defined events."""
    equation = setup.equation
    held = np.full(equation.plant.dynamics.n, np.nan) if equation.sampled else None
    return cached(setup, switching_of).at(0.0, equation.start(setup.q0, setup.v0), 0, None, held)
