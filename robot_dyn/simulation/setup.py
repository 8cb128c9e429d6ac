"""The setup of a run: plant, start, duration, controller, method. A value; `simulate` turns it into a Trajectory."""

from __future__ import annotations

from contextlib import suppress
from copy import copy
from dataclasses import dataclass, field, fields
from functools import cached_property
from math import inf
from typing import Any, final

import numpy as np

from robot_dyn import former
from robot_dyn.arithmetic import Array, Ball
from robot_dyn.control.control_law import ControlLaw
from robot_dyn.control.controller import Controller
from robot_dyn.effects.plant import Plant
from robot_dyn.effects.rigid_stops import RigidStops
from robot_dyn.errors import ControlError, EffectError, OverflowedError, QueryError, shown
from robot_dyn.foreign import call
from robot_dyn.integrate.adaptive import AUTO, Adaptive
from robot_dyn.integrate.methods import as_method
from robot_dyn.simulation.asked import asked
from robot_dyn.simulation.declarations import is_value, undeclared
from robot_dyn.simulation.event import Event
from robot_dyn.simulation.schedule import LEAST_STEPS, ON_STEP, Segment, cuts, near, nodes, steps_on
from robot_dyn.simulation.size import check_segments
from robot_dyn.simulation.state_equation import StateEquation
from robot_dyn.validate import choice, duration, instance, integer, one_state, returned, truth
from robot_dyn.values import Keeping, Value

MOST_CUT = 200_000  # steps of a run of fixed step that is cut at events
ENGINES = ("auto", "interpreted", "compiled")
STEP_S = 1e-3  # of a method of fixed step, unless given
_LONGEST_STEP_S, _LEAST_STEPS = 0.01, 200  # where a part does not declare where it switches


@final
@dataclass(frozen=True, eq=False)
class Setup(Value, Keeping):
    """All that a run depends on; what follows from it alone is computed once and kept with it, and not copied.

    Attributes:
        plant: What moves.
        q0: Position at the start, (n,).
        v0: Velocity at the start, (n,); 0 if not given.
        duration_s: In [s].
        controller: What drives it: a `Controller`; a function (t, q, v) → torque (n,), which is made one; or None.
        integrator: The method, by its name as in a scene or itself: "auto", "DOP853" and "Rosenbrock", or an `Adaptive`
            with other tolerances, choose their steps; "rk4", "order_8", "gauss_4" and others of `rd.method` have a
            fixed one.
        step_s: Fixed step, 1 ms unless given; made smaller where samples, ticks, switches and the end ask for it. It is
            not to be given for a method that chooses its steps.
        record_period_s: Time between samples; 0 for every step, or 1000 samples where the method chooses its steps.
        estimate_error: Whether companion runs are made, which cost about as much as the run; five times as much
            where only shorter steps can tell.
        about: Texts kept with the run.
        engine: "interpreted"; "compiled", the run in machine code, right angles of the file written out in
            full; or "auto", which compiles where that pays, and uses machine code that this process already has.
        events: What to look out for: steps end there, and the run does if one is terminal.
        accuracy: Largest error of q to have, over joints and times: a number for rad and m alike, or one of each, as
            {"rad": 1e-8, "m": 1e-6}, of which the least holds. Pilot runs choose method and tolerance, and the error
            estimate is the check.
    """

    plant: Plant
    q0: Array
    v0: Array = None
    duration_s: float = 1.0
    controller: Any = None
    integrator: Any = "auto"
    step_s: float | None = None
    record_period_s: float = 0.0
    estimate_error: bool = True
    about: dict[str, str] = field(default_factory=dict, repr=False)
    engine: str = "auto"
    events: tuple[Event, ...] = ()
    accuracy: Any = None

    def __post_init__(self) -> None:
        instance("plant", self.plant, Plant, "give one, as rd.Plant(robot)")
        if isinstance(getattr(self.plant.dynamics, "arithmetic", None), Ball):
            raise QueryError(
                "plant: runs are computed in floats, got dynamics in ball arithmetic; give rd.Plant(robot)"
            )
        names = self.plant.dynamics.joint_names
        if self.v0 is None:
            object.__setattr__(self, "v0", np.zeros(len(names)))
        object.__setattr__(self, "integrator", as_method(self.integrator))
        for name in ("q0", "v0"):
            object.__setattr__(self, name, one_state(name, getattr(self, name), names))
        for name in ("duration_s", "step_s", "record_period_s"):
            if (seconds := getattr(self, name)) is not None or name != "step_s":
                object.__setattr__(self, name, duration(name, seconds, zero=name == "record_period_s"))
        truth("estimate_error", self.estimate_error)
        if self.accuracy is not None:
            self._check_accuracy()
        for text in (
            text for pair in instance("about", self.about, dict, "give texts by name").items() for text in pair
        ):
            instance("about", text, str, "give texts by name")
        object.__setattr__(self, "about", dict(self.about))
        if self.integrator.controls_error and self.step_s is not None:
            raise QueryError(no_step(self.integrator.name))
        choice("engine", self.engine, ENGINES)
        object.__setattr__(self, "events", _events(self.events))
        object.__setattr__(self, "controller", _controller(self.controller, len(names)))
        self._check_model()
        check_segments(self)
        if self.events and not self.finds_events:
            raise QueryError(
                f"events: steps of {self.integrator.name} are not cut; take integrator='DOP853'"
                if self.integrator.nonsmooth
                else f"events: runs of more than {MOST_CUT} steps of {self.integrator.name} are not cut; take longer"
                " steps, or integrator='DOP853'"
            )
        self._check_set_valued()
        self._check_payloads()
        self._check_drives()
        self._check_torques()
        self._check_events()
        self.plant.actuation(np.zeros(len(names)))
        with suppress(OverflowedError):  # a start so far out is the outcome of a run
            self.plant.forward_dynamics(0.0, self.q0, self.v0, np.zeros(len(names)))  # a singular M is told at once

    def _check_accuracy(self) -> None:
        """That an accuracy is one, and that nothing else chooses method or tolerance."""
        object.__setattr__(self, "accuracy", asked(self.accuracy, self.plant.dynamics))
        if self.integrator != Adaptive(AUTO):
            raise QueryError(f"accuracy: chooses method and tolerance; leave out integrator, got {self.integrator}")
        if not self.estimate_error:
            raise QueryError("accuracy: is held to the error estimate; leave out estimate_error=False")

    def _check_set_valued(self) -> None:
        """That steps can end where joints are held and let go, and that the start is not beyond a rigid stop."""
        effects = self.plant.equation_of_motion.set_valued
        method: Any = self.integrator
        for fails, why in (
            (method.canonical, "integrates momenta"),
            (not method.controls_error and method.order < 2, "is of order 1, too low to find where"),
            (not self.finds_events, f"takes more than {MOST_CUT} steps"),
        ):
            if effects and fails and not method.nonsmooth:
                raise QueryError(
                    f"{effects[0].name}: steps must end where it holds a joint or lets it go, and {method.name} {why};"
                    " take integrator='DOP853', or 'time_stepping' with a step_s"
                )
        if method.nonsmooth and (other := [x for x in effects if not (x.rubs or x.stops)]):
            raise QueryError(f"{other[0].name}: has no law for {method.name}; take integrator='DOP853'")
        check_stops(self.plant, self.q0)

    def _check_payloads(self) -> None:
        """That the state is one of velocities where payloads come and go."""
        if self.plant.equation_of_motion.payloads and self.integrator.canonical:
            raise QueryError(
                f"carried_payload: what is picked up or dropped changes momenta, which {self.integrator.name}"
                " integrates; take integrator='DOP853'"
            )
        if self.plant.equation_of_motion.payloads and self.integrator.nonsmooth:
            raise QueryError(
                f"carried_payload: steps of {self.integrator.name} do not end where it comes and goes; take"
                " integrator='DOP853'"
            )

    def _check_drives(self) -> None:
        """That the method integrates motors with the joints that they drive."""
        for drive in self.plant.equation_of_motion.drives.values():
            if self.integrator.nonsmooth:
                raise QueryError(
                    f"{drive.name}: {self.integrator.name} takes no motors of a drive; take integrator='DOP853'"
                )

    def _check_torques(self) -> None:
        """That what the controller and each effect return at the start is one number for each joint."""
        dynamics, controller = self.plant.dynamics, self.controller
        with np.errstate(all="ignore"):
            torques = self.plant.equation_of_motion.torques(0.0, self.q0, self.v0)
            for force, torque in zip(self.plant.forces, torques, strict=True):
                returned(f"{type(force).__name__}.torque", torque, dynamics.n, error=EffectError)
                if any(each.of_actuation for each in force.thresholds(dynamics.n)):
                    raise EffectError(f"{force.name}: thresholds of the actuation are for bounds")
            equation = self.plant.equation_of_motion
            u, z = np.zeros(dynamics.n), np.zeros(equation.state_size)
            u, reached = equation.applied(u, z)
            names = (type(self.plant.effects[k]).__name__ for k in equation.states)
            rates = equation.state_rates(0.0, self.q0, self.v0, u, reached, z)
            for name, (place, rate) in zip(names, rates, strict=True):
                returned(f"{name}.state_rate", rate, place.stop - place.start, "state", error=EffectError)
        if controller is None:
            return
        with np.errstate(all="ignore"), suppress(OverflowedError):  # of its model: the outcome of a run
            start = 0.0, self.q0, self.v0, np.zeros(controller.state_size)
            torque = call(controller.torque, *start)
            returned(f"{controller.name}.torque", torque, dynamics.n, error=ControlError)
            if controller.state_size:
                after = controller.next_state if controller.period_s else controller.state_rate
                made = f"{controller.name}.{after.__name__}"
                returned(made, call(after, *start), controller.state_size, "state", error=ControlError)

    def _check_events(self) -> None:
        """That what each event returns at the start is a number."""
        for event in self.events:
            value = call(event.function, 0.0, self.q0, self.v0)
            if np.ndim(value) or not isinstance(value, int | float | np.number) or not np.isfinite(value):
                raise QueryError(f"event {event.name!r}: its function must return a finite number, got {shown(value)}")

    def _check_model(self) -> None:
        """That the controller means the joints and links of the plant; a file with other names all over may fit too."""
        plant, controller = self.plant.dynamics, self.controller
        if controller is None:
            return
        for model in controller.models.values():
            pairs = tuple(zip(model.joint_names, plant.joint_names, strict=False))
            if not any(own in plant.joint_names for own, _ in pairs):
                continue
            for own, name in pairs:
                if own != name:
                    raise QueryError(
                        f"the controller's model has the joint {own!r} where the plant has {name!r}; lock the same"
                        " joints of both"
                    )
        if controller.task_frame is not None:
            plant.placement(self.q0, controller.task_frame)  # so that an unknown link is told now

    def __getstate__(self) -> Any:
        state, frozen = super().__getstate__()
        return {each.name: state[each.name] for each in fields(self)}, frozen

    @cached_property
    def is_value(self) -> bool:
        """Whether no part but its events is the user's own code, or may change: what follows from it stays as it is."""
        return all(map(is_value, (self.plant, self.controller, self.integrator)))

    def current(self) -> Setup:
        """The setup as its parts are now: itself, or a copy without what was kept if parts may have changed since."""
        return self if self.is_value else copy(self)

    @cached_property
    def equation(self) -> StateEquation:
        """Its state equation."""
        return StateEquation(self.plant, self.controller, self.integrator.canonical, self.events)

    @cached_property
    def undeclared(self) -> tuple[tuple[Any, str], ...]:
        """Its parts that do not declare what they must, each with what to declare."""
        return undeclared(self.plant, self.controller)

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The run cut at the ticks of the controller, the breaks of its reference and the switches of effects.

        Raises:
            QueryError: If two switches lie closer together than floats can tell.
        """
        starts, step = self._cuts[:-1], self.nominal_step_s
        ends = [t for t, _ in self._cuts[1:]]
        counts = [
            steps_on(end - start, step, self.record_period_s) for (start, _), end in zip(starts, ends, strict=True)
        ]
        few = sum(count < LEAST_STEPS for count in counts)
        if LEAST_STEPS * few <= sum(counts) / 10:  # so that companion runs can take longer steps there
            counts = [max(count, LEAST_STEPS) for count in counts]
        firsts = np.cumsum([0, *counts[:-1]]).tolist()
        return tuple(
            Segment(start, end, tick, count, first)
            for (start, tick), end, count, first in zip(starts, ends, counts, firsts, strict=True)
        )

    stretches = former.Attribute("segments")

    @cached_property
    def _cuts(self) -> list[tuple[float, bool]]:
        switches = {t for effect in self.plant.effects for t in effect.switches}
        switches |= set(self.controller.knots if self.controller else ())
        period, instants = (self.controller.period_s, self.controller.instants) if self.controller else (0.0, (0.0,))
        return cuts(self.duration_s, period, switches, instants)

    @property
    def ends_on_tick(self) -> bool:
        """Whether the controller acts at the end of the run."""
        return self._cuts[-1][1]

    @property
    def finds_events(self) -> bool:
        """Whether steps end where effects and the controller switch, and at events asked for."""
        if self.integrator.controls_error or self.integrator.nonsmooth:
            return not self.integrator.nonsmooth
        return self.equation.switches and self.steps <= MOST_CUT

    @property
    def samples_on_steps(self) -> bool:
        """Whether each sample of a method of fixed step is at the end of a step that is not cut."""
        if not self.record_period_s:
            return True
        ends, due = nodes(self.segments), np.arange(0.0, self.duration_s, self.record_period_s)
        return bool((np.abs(near(ends, due) - due) <= ON_STEP * self.nominal_step_s).all())

    @property
    def steps(self) -> int:
        """Number of steps of a method of fixed step."""
        return self.segments[-1].first + self.segments[-1].steps

    @property
    def nominal_step_s(self) -> float:
        """Step of a method of fixed step before it is made smaller, in [s]."""
        return STEP_S if self.step_s is None else self.step_s

    @property
    def taken_step_s(self) -> float:
        """Longest step that a method of fixed step takes, in [s]: at most `nominal_step_s` and the record period."""
        return max((each.end - each.start) / each.steps for each in self.segments)

    @property
    def longest_step_s(self) -> float:
        """Longest step that an adaptive method may take, in [s]: 10 ms and 1/200 of the run with an undeclared part.

        What does not declare where it switches may act between the ends of a step, and error control does not see what
        no stage meets. A fixed step is the user's.
        """
        longest = min(_LONGEST_STEP_S, self.duration_s / _LEAST_STEPS)
        return longest if self.undeclared else inf


def check_stops(plant: Plant, q0: Array, of: str = "q0") -> None:
    """That a start is not beyond a rigid stop.

    Raises:
        QueryError: If it is; names the joint, and by `of` the start.
    """
    for each in plant.effects:
        if isinstance(each, RigidStops) and (depth := each.beyond_by(q0)).any():
            i = int(np.argmax(depth))
            name, which = plant.dynamics.joint_names[i], "lower" if each.touched(q0)[i] < 0 else "upper"
            raise QueryError(f"{of}: {name!r} is {depth[i]:.3g} beyond its {which} stop; start between the stops")


def no_step(name: str) -> str:
    """What is wrong with a step for a method that chooses its own."""
    return (
        f"step_s has no effect on {name}, which chooses its steps: leave it out, name a method of fixed step, such as"
        " integrator='rk4', or give rd.Adaptive(max_step_s=…)"
    )


def _events(given: Any) -> tuple[Event, ...]:
    """The events that are meant: several, or one."""
    given = (given,) if isinstance(given, Event) else given
    if not isinstance(given, tuple | list):
        raise QueryError(f"events: give a list of rd.Event, got {shown(given)}")
    return tuple(instance("events", each, Event, "give a list of rd.Event") for each in given)


def _controller(given: Any, n: int) -> Controller | None:
    """The controller of n joints that is meant; raises QueryError if it is not one."""
    made: Any = given
    if callable(given) and not isinstance(given, Controller) and not isinstance(given, type):
        made = ControlLaw(given, n)
    instance("controller", made, Controller | None, "give one, such as rd.PD(…), a function of (t, q, v), or None")
    if made is not None:
        duration("period_s of the controller", made.period_s, zero=True)
        if made.n != n:
            raise QueryError(f"the controller drives {made.n} joints, the plant has {n}")
        integer("state_size of the controller", made.state_size)
    return made
