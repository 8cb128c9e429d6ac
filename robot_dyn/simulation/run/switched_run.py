"""What a run does in Python behind events: words, sides and modes that are not known yet, payloads, and ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import Any

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.convex import not_found
from robot_dyn.errors import NotFiniteError, OverflowedError, RobotDynError
from robot_dyn.integrate.step_control import At
from robot_dyn.simulation.dynamics.loop_state import Ended, Functions, Now, Rules, Runs
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.events.crossings import Switches
from robot_dyn.simulation.events.event_log import CHATTER, EventLog, What, remember_time
from robot_dyn.simulation.events.holding import Holding, part, write_mode
from robot_dyn.simulation.events.mode_change import change
from robot_dyn.simulation.events.modes import Modes
from robot_dyn.simulation.events.occurrence import Occurrence
from robot_dyn.simulation.events.payload_events import PayloadEvents
from robot_dyn.simulation.events.sides import Sides, keep_numbers, sides_of
from robot_dyn.simulation.events.switching import Switching
from robot_dyn.simulation.observation.remarks import Kind, Remark
from robot_dyn.simulation.run.driver import Driver
from robot_dyn.simulation.run.watch import DivergedError, Watch
from robot_dyn.simulation.setup.segment_table import SegmentTable
from robot_dyn.simulation.setup.setup import STEP_S, Setup
from robot_dyn.threshold import Threshold

Made = Callable[[StateEquation], tuple[Functions, np.ndarray]]


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


class SwitchedRun(Driver):
    """A run whose equation switches at events.

    Attributes:
        setup, equation, watch, transfers: Of the run, with what it carries now.
        made: As of `EventRun`.
        table, runs, rules, control, switches, sides: What the loop takes.
        switching: Its switching functions, and its modes.
        functions, in_python: Of the state equation on the sides that the run is on; as Python calls them, if that is
            machine code.
        bodies: The function of that name, of the equation whose parts switch by themselves.
        events, log: What happened, and what the loop has noted since it was called.
        samples: Whether samples are kept.
        chooses: Whether another method may make the run.
        beyond: The time of a terminal event that a companion has passed, in [s].
        met: Why the rate had no value.
    """

    setup: Setup
    equation: StateEquation
    watch: Watch
    transfers: PayloadEvents
    made: Made
    table: SegmentTable
    runs: Runs
    rules: Rules
    control: Array
    switches: Switches
    sides: Sides
    switching: Switching
    functions: Functions
    in_python: Functions | None
    bodies: Any
    events: list[Occurrence]
    log: EventLog
    samples: bool
    chooses: bool
    beyond: float = inf
    met: RobotDynError | None = None

    @property
    def y(self) -> np.ndarray:
        """The state reached."""
        return self.runs.y[:, 0].copy()

    def _tell(self) -> None:
        """Keep what happened in the loop, in words."""
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
        if switching.thresholds or switching.dropped or self.transfers.any:
            functions, parameters = self.made(switching.on(self.switches.sides))
            self.functions, self.runs.run_parameters[self.rules.held :, 0] = (
                functions._replace(bodies=self.bodies),
                parameters,
            )
            if self.in_python is not None:  # else functions change with the sides
                keep_numbers(self.sides, switching.of_thresholds(self.switches.sides), parameters)
        if switching.modes is not None:
            write_mode(switching.modes.holding, self.runs.run_parameters)
        if not self.compiled:
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

        made: Any = functions._replace(rate=rate)
        return made

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
        held = self.runs.run_parameters[: self.rules.held, 0] if self.rules.held else None
        self._watch_anew(last.t, held)

    def _end_mode(self, ended: Ended, t: float, y: np.ndarray) -> None:
        """Behind the end of a mode: what the loop leaves to be done, or cannot do."""
        modes = self.switching.modes
        assert modes is not None
        if ended is Ended.UNSETTLED:
            room = modes.holding.room
            raise not_found(room.whole[:, : len(room.load)], room.load)
        if ended is Ended.ACCUMULATED:
            guard = int(self.now[Now.EVENT]) - self.switches.thresholds
            self._accumulated(t, y, modes.holding, modes.joint(guard))
        self._watch_anew(t, self.runs.run_parameters[: self.rules.held, 0] if self.rules.held else None)
        self._change_mode()

    def _transfer(self, s: int) -> None:
        """Go on with what is carried from the start of a segment on."""
        t, held = (
            float(self.table.starts[s]),
            self.runs.run_parameters[: self.rules.held, 0] if self.rules.held else None,
        )
        self.runs.y[:, 0], happened = self.transfers.over(t, self.y)
        self.equation = self.watch.equation = self.transfers.equation
        self._keep(*happened)
        functions, parameters = self.made(self.equation)
        self.bodies = functions.bodies
        if (modes := self.switching.modes) is not None:
            run_parameters = np.concatenate([np.full(self.rules.held, np.nan), parameters])[:, None]
            modes = Modes(self.equation, modes.holding._replace(run_parameters=run_parameters))
            self._settle(modes, self.in_python or functions, t, self.table.parameters[s])
        self.switching = Switching(self.equation, self.switching.dropped, modes)
        self._forget_sides()
        self._tell()
        self.table.transfers[s] = 0
        self._watch_anew(t, held)
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

    def _accumulated(self, t: float, y: np.ndarray, holding: Holding, joint: str) -> None:
        """AccumulationError if another method may make the run, else DivergedError."""
        first = float(holding.changes[holding.changed[0] % len(holding.changes)])
        what = f"{len(holding.changes)} changes of what holds joints in {t - first:.1e} s, the last of joint {joint!r}"
        motion = self.equation.equation_of_motion
        alone = motion.payloads or motion.drives  # which time stepping does not take
        if alone or not self.chooses:
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
        index = self.switching.number(index)
        if index < E:
            self._keep(self.switching.occurrence(index, t, y, side))
            if self.setup.integrator.needs_jacobian:
                self.control[At.NEXT] = 0.0  # an L-stable step damps what is fast: to start with, it must be resolved
            if self._chatters():
                self._drop(self.switching.thresholds[index])
            self._change_mode()
            return
        event = self.setup.events[index - E]
        if event.direction in (0, int(side)):
            self._keep(self.switching.occurrence(index, t, y, side))
            if event.terminal and self.samples:
                raise TerminalEvent(t, event.name)
            if event.terminal:  # a companion goes on, past the states of the run at which they are compared
                self.beyond = min(self.beyond, t)
