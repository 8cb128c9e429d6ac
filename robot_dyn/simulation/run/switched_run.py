"""What a run does in Python behind events: sides and modes that are not known yet, payloads, and ends."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import Any

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.convex import not_found
from robot_dyn.foundations.errors import NotFiniteError, OverflowedError, RobotDynError
from robot_dyn.foundations.threshold import Threshold
from robot_dyn.integrate.step_control import At
from robot_dyn.simulation.dynamics.event import Occurrence
from robot_dyn.simulation.dynamics.loop_state import Ended, Functions, Now
from robot_dyn.simulation.events.crossings import Switches
from robot_dyn.simulation.events.event_log import CHATTER, EventLog, What, remember_time
from robot_dyn.simulation.events.holding import Holding, part, write_mode
from robot_dyn.simulation.events.mode_change import change
from robot_dyn.simulation.events.modes import Modes
from robot_dyn.simulation.events.sides import Sides, keep_numbers, sides_of
from robot_dyn.simulation.events.switching import Switching
from robot_dyn.simulation.observation.remarks import Remark, RemarkKind
from robot_dyn.simulation.run.driver import Driver
from robot_dyn.simulation.run.outcome import Accumulation, Outcome, Reason
from robot_dyn.simulation.run.watch import DivergedError
from robot_dyn.simulation.setup.setup import STEP_S


class SwitchedRun(Driver):
    """A run whose equation switches at events.

    Attributes:
        control, switches, sides: What the loop takes, too.
        switching: Its switching functions, and its modes.
        bodies: The function of that name, of the equation whose parts switch by themselves.
        log: What the loop has noted since it was called.
        samples: Whether samples are recorded.
        chooses: Whether another method may make the run.
        past_horizon: The time of a terminal event that a companion has passed, in [s].
        met: Why the rate had no value.
    """

    control: Array
    switches: Switches
    sides: Sides
    switching: Switching
    bodies: Any
    log: EventLog
    samples: bool
    chooses: bool
    past_horizon: float = inf
    met: RobotDynError | None = None

    def _take_log(self) -> None:
        """Take the events that the loop has noted."""
        count, self.log.filled[0] = int(self.log.filled[0]), 0
        if count:
            happened = [self._occurrence(row) for row in self.log.rows[:count].tolist()]
            self.events = sorted([*self.events, *happened], key=lambda each: each.t)

    def _keep(self, *happened: Occurrence) -> None:
        """Keep events that Python sees."""
        self.events += happened
        for each in happened:
            remember_time(self.log, each.t)

    def _occurrence(self, row: list[float]) -> Occurrence:
        if self.switching.modes is not None and row[2] != What.PASSES:
            return self.switching.modes.occurrence(row)
        t, number, _, side, _, *state = row
        y = np.zeros(self.equation.size)
        y[: len(state)] = state
        return self.switching.occurrence(int(number), t, y, side)

    def _change_mode(self) -> None:
        """Let the functions be those of the sides that the switching functions are on."""
        switching = self.switching
        if switching.thresholds or switching.dropped or self.payloads.any:
            on_sides = switching.on(self.switches.sides)
            functions, self.in_python, parameters, by_numbers = self.engine.evaluated(on_sides, self.watch)
            self.functions = functions._replace(bodies=self.bodies)
            self.runs.run_parameters[self.rules.held :, 0] = parameters
            if by_numbers:  # else functions change with the sides
                keep_numbers(self.sides, switching.of_thresholds(self.switches.sides), parameters)
        if switching.modes is not None:
            write_mode(switching.modes.holding, self.runs.run_parameters)
        if callable(self.functions.rate):
            self.functions = self._lenient(self.functions)

    def _forget_sides(self) -> None:
        """Room for the numbers of the run on sides of its thresholds; none is known."""
        count, run_parameters = len(self.switching.thresholds), len(self.runs.run_parameters) - self.rules.held
        asked = np.array([[each.direction, each.terminal] for each in self.setup.events], float).reshape(-1, 2)
        restarts = self.setup.integrator.needs_jacobian
        self.sides = sides_of(count, run_parameters, asked[:, 0].copy(), asked[:, 1] > 0, restarts, self.log)

    def _lenient(self, functions: Functions) -> Functions:
        """The functions in Python, with a rate that is nan where a trial step goes too far: a shorter one is tried."""

        def rate(t: float, y: Array, p: Array, run_parameters: Array, out: Array) -> None:
            try:
                functions.rate(t, y, p, run_parameters, out)
            except (OverflowedError, NotFiniteError) as error:
                self.met, out[...] = error, np.nan

        return functions._replace(rate=rate)

    def _chatters(self) -> bool:
        """Whether the latest events were all of one threshold, in next to no time."""
        latest = self.events[-CHATTER:]
        brief = latest[-1].t - latest[0].t <= self.log.brief
        return len(latest) == CHATTER and brief and len({each.joint for each in latest} - {""}) == 1

    def _drop(self, each: Threshold) -> None:
        """Look for the thresholds of a joint no longer, where steps would never get on."""
        last = self.events[-1]
        self.events.append(replace(last, name=f"{last.name} chatters, and is no longer looked for"))
        dropped = self.switching.dropped | {(each.joint, each.of_actuation)}
        self.switching = Switching(self.equation, dropped, self.switching.modes)
        self._forget_sides()
        self._renew_switches(last.t)

    def _end_mode(self, ended: Ended, t: float, y: np.ndarray) -> Accumulation | None:
        """Behind the end of a mode: what the loop leaves to be done, or cannot do; why the run gives up, if it does."""
        modes = self.switching.modes
        assert modes is not None
        if ended is Ended.UNSETTLED:
            room = modes.holding.room
            raise not_found(room.whole[:, : len(room.load)], room.load)
        if ended is Ended.ACCUMULATED:
            guard = int(self.now[Now.EVENT]) - self.switches.thresholds
            return self._accumulated(t, y, modes.holding, modes.joint(guard))
        self._renew_switches(t)
        self._change_mode()
        return None

    def _change_carried(self) -> None:
        """Go on with what is carried from the start of a segment on, in a mode of its own."""
        s = int(self.now[Now.SEGMENT])
        t = float(self.table.starts[s])
        self._keep(*self._change_payload())
        self.bodies = self.functions.bodies
        if (modes := self.switching.modes) is not None:
            run_parameters = self.runs.run_parameters.copy()
            run_parameters[: self.rules.held] = np.nan
            modes = Modes(self.equation, modes.holding._replace(run_parameters=run_parameters))
            self._settle(modes, self.in_python, t, self.table.parameters[s])
        self.switching = Switching(self.equation, self.switching.dropped, modes)
        self._forget_sides()
        self._take_log()
        self._renew_switches(t)
        if self.setup.integrator.needs_jacobian:
            self.control[At.NEXT] = 0.0
        self._change_mode()

    def _settle(self, modes: Modes, functions: Functions, t: float, p: Array) -> None:
        """The mode behind a jump of the state."""
        holding, y = modes.holding, self.runs.y
        part(holding.laws, y)
        with np.errstate(all="ignore"):
            found = change(functions, t, y, p, self.runs.run_parameters, holding, -1)
        if not found:
            raise not_found(holding.room.whole[:, : len(holding.room.load)], holding.room.load)

    def _accumulated(self, t: float, y: np.ndarray, holding: Holding, joint: str) -> Accumulation:
        """Why another method is to make the run; DivergedError if none may."""
        first = float(holding.changes[holding.changed[0] % len(holding.changes)])
        span = float(np.ptp(holding.changes))  # a step that was taken back may have noted a later one
        motion = self.equation.equation_of_motion
        alone = motion.payloads or motion.drives  # which time stepping does not take
        if alone or not self.chooses:
            remedy = "soft stops and regularised friction" if alone else "integrator='time_stepping' and a step_s"
            facts = {"changes": len(holding.changes), "span_s": span, "remedy": remedy}
            raise DivergedError(Outcome(Reason.EVENTS_ACCUMULATE, t, joint, facts))
        speed = float(np.abs(y[self.rules.n : 2 * self.rules.n]).max())
        facts = {"changes": len(holding.changes), "span_s": span, "step_s": STEP_S}
        return Accumulation(Remark(RemarkKind.ACCUMULATE, joint, "v", first, t - first, t, speed, None, facts))

    def _renew_switches(self, t: float) -> None:
        """The switching functions of the state reached."""
        degree, functions = len(self.switches.b) - 1, self.switches.functions
        self.switches = self.switching.at(t, self.y, degree, functions, self.held)

    def _event(self, t: float, y: np.ndarray) -> str | None:
        """Keep an event, and go on behind it; the name of one that ends the run, else None."""
        index, E = int(self.now[Now.EVENT]), len(self.switching.thresholds)
        side = float(self.switches.sides[index])
        index = self.switching.number(index)
        if index < E:
            self._keep(self.switching.occurrence(index, t, y, side))
            if self.setup.integrator.needs_jacobian:
                self.control[At.NEXT] = 0.0  # an L-stable step damps what is fast: to start with, it must be resolved
            if self._chatters():
                self._drop(self.switching.thresholds[index])
            self._change_mode()
            return None
        event = self.setup.events[index - E]
        if event.direction not in (0, int(side)):
            return None
        self._keep(self.switching.occurrence(index, t, y, side))
        if not event.terminal:
            return None
        if self.samples:
            return event.name
        self.past_horizon = min(self.past_horizon, t)  # a companion goes on, past the states that are compared
        return None
