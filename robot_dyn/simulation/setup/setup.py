"""The setup of a run: plant, start, duration, controller, method. A value; `simulate` turns it into a Trajectory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from math import inf, ulp
from sys import float_info
from typing import Any, final

import numpy as np

from robot_dyn.control.controller import ControlLaw, Controller
from robot_dyn.effects.explanation import Explanation, explanation
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.arithmetic import Ball
from robot_dyn.foundations.errors import QueryError, shown
from robot_dyn.foundations.validate import LEAST_EXACT, choice, duration, instance, integer, one_state, truth
from robot_dyn.foundations.values import Caching, Value
from robot_dyn.integrate.adaptive import AUTO, Adaptive
from robot_dyn.integrate.methods import as_method
from robot_dyn.queries.units import joint_units
from robot_dyn.simulation.dynamics.declarations import is_value, undeclared
from robot_dyn.simulation.dynamics.event import Event
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.setup.checks import check_method, check_model, check_start, least_accuracy
from robot_dyn.simulation.setup.explanation import control_lines, law
from robot_dyn.simulation.setup.schedule import LEAST_STEPS, MOST_CUT, ON_STEP, Segment, cuts, near, nodes, steps_on

ENGINES = ("auto", "interpreted", "compiled")
MOST_BYTES = 8 * 2**30  # of all that is recorded, by default
LONGEST_S = LEAST_EXACT / float_info.epsilon  # up to there floats resolve the times of a run
MOST_STEPS = 1e11  # about a day of the fastest machine code
_SEGMENT_BYTES, _SEGMENT_BYTES_PER_JOINT = 500, 100  # by estimate; the second is a quintic at its start and along it
STEP_S = 1e-3  # of a method of fixed step, unless given
_LONGEST_STEP_S, _LEAST_STEPS = 0.01, 200  # where a part does not declare where it switches

CACHED = {
    "table_of": "its segments as arrays",
    "single_run_config": "the settings of a loop of fixed steps",
    "event_config": "the settings of a loop with events",
    "companion_config": "the settings of its companion runs",
    "start_energies": "kinetic and potential energy at the start",
    "switching_of": "its switching functions",
    "start_table_of": "their values at the start",
    "observed_start": "the levels to observe, and the observation of the start",
    "speed_limits": "the largest plausible speed of each joint",
    "engine_of": "its machine code, once checked",
    "with_stiff_method": "the same setup by the stiff method",
    "with_time_stepping": "the same setup by time stepping",
}
"""All that is cached with a setup, by the function that computes it; see `foundations.values.cached`."""


@final
@dataclass(frozen=True, eq=False)
class Setup(Value, Caching):
    """Everything a run depends on. Derived values are cached, see `CACHED`, and not copied.

    Attributes:
        plant: What moves.
        q0: Position at the start, (n,).
        v0: Velocity at the start, (n,); 0 if not given.
        duration_s: In [s].
        controller: What drives it: a `Controller`; a function (t, q, v) → torque (n,), which becomes one; or None.
        method: The integration method, or its name, see `rd.integrate.method`. "auto", "DOP853" and "Rodas5P" choose
            their steps, as does an `Adaptive` with other tolerances; others, such as "RK4", have a fixed step.
        step_s: Fixed step, 1 ms unless given; shortened where samples, ticks, switches and the end require it. It is
            not to be given for a method that chooses its steps.
        record_every_s: Time between samples; 0 for every step, or 1000 samples where the method chooses its steps.
        estimate_error: Whether companion runs estimate the error, which cost one to two times as much as the run; five
            times where only shorter steps can show it.
        about: Texts stored with the run.
        engine: "interpreted"; "compiled", the run in machine code, right angles of the file written out in
            full; or "auto", which compiles where that is worthwhile, and uses machine code that exists already.
        events: Events to find: steps end there, and the run does if one is terminal.
        accuracy: Largest error of q over joints and times: a number for rad and m alike, or one of each, as
            {"rad": 1e-8, "m": 1e-6}, of which the least holds. Pilot runs choose method and tolerance, and the error
            estimate is the check.
    """

    plant: Plant
    q0: Any  # array-like; arrays once built
    v0: Any = None
    duration_s: float = 1.0
    controller: Any = None
    method: Any = "auto"
    step_s: float | None = None
    record_every_s: float = 0.0
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
        object.__setattr__(self, "method", as_method(self.method))
        for name in ("q0", "v0"):
            object.__setattr__(self, name, one_state(name, getattr(self, name), names))
        for name in ("duration_s", "step_s", "record_every_s"):
            if (seconds := getattr(self, name)) is not None or name != "step_s":
                object.__setattr__(self, name, duration(name, seconds, zero=name == "record_every_s"))
        truth("estimate_error", self.estimate_error)
        if self.accuracy is not None:
            self._check_accuracy()
        for text in (
            text for pair in instance("about", self.about, dict, "give texts by name").items() for text in pair
        ):
            instance("about", text, str, "give texts by name")
        object.__setattr__(self, "about", dict(self.about))
        if self.method.controls_error and self.step_s is not None:
            raise QueryError(no_step(self.method.name))
        choice("engine", self.engine, ENGINES)
        object.__setattr__(self, "events", _events(self.events))
        object.__setattr__(self, "controller", _controller(self.controller, len(names)))
        if self.controller is not None:
            check_model(self.plant.dynamics, self.controller, self.q0)
        _check_segments(self)
        check_method(self.plant, self.method, self.events, self.finds_events)
        check_start(self.plant, self.controller, self.events, self.q0, self.v0)  # pyright: ignore[reportArgumentType]

    def _check_accuracy(self) -> None:
        """That an accuracy is one, and that nothing else chooses method or tolerance."""
        object.__setattr__(self, "accuracy", least_accuracy(self.accuracy, self.plant.dynamics))
        if self.method != Adaptive(AUTO):
            name = self.method.name
            raise QueryError(f"accuracy: chooses method and tolerances; leave out method, rtol and atol, got {name!r}")
        if not self.estimate_error:
            raise QueryError("accuracy: is held to the error estimate; leave out estimate_error=False")

    def __repr__(self) -> str:
        return f"<Setup: {explanation_of(self)}>"

    def _repr_html_(self) -> str:
        return explanation_of(self)._repr_html_()

    def __getstate__(self) -> Any:
        state, frozen = super().__getstate__()
        return {each.name: state[each.name] for each in fields(self)}, frozen

    @cached_property
    def is_value(self) -> bool:
        """Whether no part but its events is user-defined code, or may change: what follows from it stays as it is."""
        return all(map(is_value, (self.plant, self.controller, self.method)))

    @cached_property
    def equation(self) -> StateEquation:
        """Its state equation."""
        return StateEquation(self.plant, self.controller, self.method.canonical, self.events)

    @cached_property
    def undeclared(self) -> tuple[tuple[Any, str], ...]:
        """Its parts that do not declare what they must, each with what to declare."""
        return undeclared(self.plant, self.controller)

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The run cut at the ticks of the controller, the breaks of its reference and the switches of effects.

        Raises:
            QueryError: If two switches lie closer together than floats resolve.
        """
        starts, step = self._cuts[:-1], self.nominal_step_s
        ends = [t for t, _ in self._cuts[1:]]
        counts = [
            steps_on(end - start, step, self.record_every_s) for (start, _), end in zip(starts, ends, strict=True)
        ]
        few = sum(count < LEAST_STEPS for count in counts)
        if LEAST_STEPS * few <= sum(counts) / 10:  # so that companion runs can take longer steps there
            counts = [max(count, LEAST_STEPS) for count in counts]
        firsts = np.cumsum([0, *counts[:-1]]).tolist()
        return tuple(
            Segment(start, end, tick, count, first)
            for (start, tick), end, count, first in zip(starts, ends, counts, firsts, strict=True)
        )

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
        """Whether steps end where effects and the controller switch, and at requested events."""
        if self.method.controls_error or self.method.nonsmooth:
            return not self.method.nonsmooth
        return self.equation.switches and self.steps <= MOST_CUT

    @property
    def samples_on_steps(self) -> bool:
        """Whether each sample of a method of fixed step is at the end of a step that is not cut."""
        if not self.record_every_s:
            return True
        ends, due = nodes(self.segments), np.arange(0.0, self.duration_s, self.record_every_s)
        return bool((np.abs(near(ends, due) - due) <= ON_STEP * self.nominal_step_s).all())

    @property
    def steps(self) -> int:
        """Number of steps of a method of fixed step."""
        return self.segments[-1].first + self.segments[-1].steps

    @property
    def nominal_step_s(self) -> float:
        """Step of a method of fixed step before it is shortened, in [s]."""
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


def no_step(name: str) -> str:
    """What is wrong with a step for a method that chooses its own."""
    return (
        f"step_s has no effect on {name}, which chooses its steps: leave it out, name a method of fixed step, such as"
        " method='RK4', or give rd.integrate.Adaptive(max_step_s=…)"
    )


def _events(given: Any) -> tuple[Event, ...]:
    """The events that are meant: several, or one."""
    given = (given,) if isinstance(given, Event) else given
    if not isinstance(given, tuple | list):
        raise QueryError(f"events: give a list of rd.Event, got {shown(given)}")
    return tuple(instance("events", each, Event, "give a list of rd.Event") for each in given)


def _controller(given: Any, n: int) -> Controller | None:
    """The controller of n joints that is meant; raises QueryError if it is not one."""
    controller: Any = given
    if callable(given) and not isinstance(given, Controller) and not isinstance(given, type):
        controller = ControlLaw(given, n)
    instance(
        "controller",
        controller,
        Controller | None,
        "give one, such as rd.control.PD(…), a function of (t, q, v), or None",
    )
    if controller is not None:
        duration("period_s of the controller", controller.period_s, zero=True)
        if controller.n != n:
            raise QueryError(f"the controller drives {controller.n} joints, the plant has {n}")
        integer("state_size of the controller", controller.state_size)
    return controller


def _check_segments(setup: Setup) -> None:
    """Refuse a run of more steps, ticks or switches than are possible, or of times that floats do not resolve.

    Raises:
        QueryError: If it is one; with the number and the remedy.
    """
    cut = segments(setup)
    size = cut * (_SEGMENT_BYTES + _SEGMENT_BYTES_PER_JOINT * setup.plant.dynamics.n)
    if size > MOST_BYTES:
        raise QueryError(
            f"a run of {setup.duration_s:g} s with {cut:.3g} ticks and switches takes {gibibytes(size)}, more than "
            f"{gibibytes(MOST_BYTES)}: take a longer period_s of the controller, or a shorter duration_s"
        )
    if steps(setup) > MOST_STEPS:
        raise QueryError(
            f"a run of {setup.duration_s:g} s takes {steps(setup):.3g} steps of step_s = {setup.nominal_step_s:g} s,"
            f" more than {MOST_STEPS:g}: take a longer step_s, or a shorter duration_s"
        )
    if setup.duration_s > LONGEST_S:
        raise QueryError(
            f"a run of {setup.duration_s:g} s ends at a time that floats resolve to {ulp(setup.duration_s):.1g} s only:"
            f" take a shorter duration_s, {LONGEST_S:.2g} s at most"
        )


def segments(setup: Setup) -> float:
    """At most so many segments between ticks, breaks and switches."""
    controller = setup.controller
    period = controller.period_s / len(controller.instants) if controller else 0.0
    cuts = sum(len(effect.switches) for effect in setup.plant.effects) + len(controller.knots if controller else ())
    return 2.0 + cuts + (setup.duration_s / period if period > 0 else 0.0)


def steps(setup: Setup) -> float:
    """About so many steps of a fixed-step method; 0 for an adaptive one, which chooses them."""
    if setup.method.controls_error:
        return 0.0
    step = min(setup.nominal_step_s, setup.record_every_s or inf)  # samples lie on steps
    return setup.duration_s / step + 4 * segments(setup)


def gibibytes(size: float) -> str:
    """Return a number of bytes as text, in GiB."""
    return f"{size / 2**30:.3g} GiB"


def check_record(setup: Setup) -> None:
    """Refuse a run whose samples take more than MOST_BYTES.

    Raises:
        QueryError: If they do; with the size and the remedy.
    """
    equation = setup.equation
    n, s, m = equation.plant.dynamics.n, len(equation.sources), len(equation.widths)
    # t, y, zero-order hold; q, v, a, u, work, power, energies; desired, deviation; and copies of all meanwhile
    size = 2 * 8 * samples(setup) * (1 + m + n + 4 * n + 2 * s + 2 + 2 * n)
    if size > MOST_BYTES:
        raise too_large(f"{samples(setup):.3g} samples", size, MOST_BYTES)


def check_batch(setup: Setup, runs: int, numbers: int, most: float) -> None:
    """Refuse a batch of so many runs, with so many numbers in each sample, that takes more than `most` bytes.

    Raises:
        QueryError: If it does; with the size and the remedy.
    """
    size = 8 * samples(setup) * runs * numbers
    if size > most:
        raise too_large(
            f"at most {samples(setup):.3g} samples of {runs} runs", size, most, ", fewer runs, or record less"
        )


def too_large(what: str, size: float, most: float, or_else: str = "") -> QueryError:
    """The refusal of a record."""
    remedy = f"take a longer record_every_s or a shorter duration_s{or_else}"
    return QueryError(f"recording {what} takes {gibibytes(size)}, more than {gibibytes(most)}: {remedy}")


def samples(setup: Setup) -> float:
    """At most so many samples."""
    periods = setup.duration_s / setup.record_every_s + 2 if setup.record_every_s else inf
    adaptive = setup.method.controls_error
    return min(periods, 1000 + segments(setup) if adaptive and periods == inf else inf, steps(setup) or inf)


def explanation_of(setup: Setup) -> Explanation:
    """Explain a setup in words: the equation of motion, effects, control, method and start."""
    plant, controller = explanation(setup.plant.dynamics, setup.plant.effects), setup.controller
    return replace(
        plant,
        equation=(*plant.equation, f"u = {'0' if controller is None else law(controller)}"),
        control=() if controller is None else tuple(control_lines(controller, setup.plant.dynamics)),
        method=tuple(_method(setup)),
    )


def shortened(setup: Setup) -> str:
    """The longest step that a method of fixed step takes, if that is not its own; else empty."""
    taken = setup.taken_step_s
    if taken >= setup.nominal_step_s * (1 - 1e-9):
        return ""
    return f", in fact {taken:.6g} at most: steps end at samples, ticks and switches"


def _method(setup: Setup) -> Iterator[str]:
    method: Any = setup.method
    name: str = method.name
    used: dict[str, Any] = {}
    if setup.accuracy is not None:
        name = f"chosen for an error of q of at most {setup.accuracy:g}"
    elif method.controls_error:
        used = {"rtol": method.rtol, "atol": method.atol}
    else:
        used = {"step_s": f"{setup.nominal_step_s}{shortened(setup)}"}
    yield f"method: {name}, {setup.duration_s:g} s"
    used |= {key: getattr(setup, key) for key in ("record_every_s", "estimate_error", "engine")}
    yield from (f"  {key} = {value}" for key, value in used.items())
    yield "start:"
    types = getattr(setup.plant.dynamics, "joint_types", (None,) * len(setup.q0))
    for key, values in (("q", setup.q0), ("v", setup.v0)):
        numbers = ", ".join(f"{x:.6g}" for x in values) if values.any() else "0"
        yield f"  {key} = {numbers} {joint_units(key, types)}"
