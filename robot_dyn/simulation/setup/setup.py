"""The setup of a run: an immutable value of plant, start, duration, controller and method, which `simulate` runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from math import inf, ulp
from sys import float_info
from typing import TYPE_CHECKING, Any, TypedDict, Unpack, final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.control.controller import ControlLaw, Controller
from robot_dyn.effects.explanation import Explanation, explanation
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.arithmetic import Ball
from robot_dyn.foundations.errors import QueryError, shown
from robot_dyn.foundations.validate import (
    MAX_ROUNDING_ERROR,
    JointValues,
    choice,
    duration,
    instance,
    integer,
    one_state,
    truth,
)
from robot_dyn.foundations.values import Caching, Value
from robot_dyn.integrate.adaptive import AUTO, Adaptive
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.integrate.methods import as_method
from robot_dyn.queries.units import joint_units
from robot_dyn.simulation.dynamics.declarations import is_value, undeclared
from robot_dyn.simulation.dynamics.event import Event
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.setup.checks import Accuracy, check_method, check_model, check_start, least_accuracy
from robot_dyn.simulation.setup.explanation import control_lines, law
from robot_dyn.simulation.setup.schedule import LEAST_STEPS, MOST_CUT, ON_STEP, Segment, cuts, near, nodes, steps_on

ENGINES = ("auto", "interpreted", "compiled")
MOST_BYTES = 8 * 2**30  # default limit of all records
LONGEST_S = MAX_ROUNDING_ERROR / float_info.epsilon  # floats resolve the times of a run up to here
MOST_STEPS = 1e11  # about a day of the fastest machine code
_SEGMENT_BYTES, _SEGMENT_BYTES_PER_JOINT = 500, 100  # estimates; the second for two rows of a quintic reference
STEP_S = 1e-3  # default step of a method of fixed step
_LONGEST_STEP_S, _LEAST_STEPS = 0.01, 200  # adaptive method with a part that declares no switches

CACHED = {
    "table_of": "the segments as arrays",
    "single_run_config": "the settings of a loop of fixed steps",
    "event_config": "the settings of a loop with events",
    "start_energies": "kinetic and potential energy at the start",
    "switching_of": "the switching functions",
    "start_table_of": "the values of the switching functions at the start",
    "observed_start": "the levels to observe, and the observation of the start",
    "speed_limits": "the largest plausible speed of each joint",
    "engine_of": "the machine code, after its check",
    "with_stiff_method": "the same setup with the stiff method",
    "with_time_stepping": "the same setup with time stepping",
}
"""All values cached with a setup, by the function that computes them; see `foundations.values.cached`."""


class Options(TypedDict, total=False):
    """Attributes of a `Setup` other than plant and start, in the forms it accepts; tolerances of its method."""

    duration_s: float
    controller: Controller | Callable[[float, np.ndarray, np.ndarray], ArrayLike] | None
    method: str | Integrator | Adaptive
    rtol: float | None
    atol: float | None
    step_s: float | None
    record_every_s: float
    estimate_error: bool
    metadata: dict[str, str]
    engine: str
    events: Event | Sequence[Event]
    accuracy: Accuracy | None


@final
@dataclass(frozen=True, eq=False)
class Setup(Value, Caching):
    """Everything a run depends on. Derived values are cached, see `CACHED`, and not copied.

    Attributes:
        plant: The arm with the effects that act on it.
        q0: Position at the start, (n,).
        v0: Velocity at the start, (n,); 0 by default.
        duration_s: Length of the run, in [s].
        controller: A `Controller`; a function (t, q, v) → torque (n,), which becomes one; or None.
        method: The integration method, or its name, see `rd.integrate.method`. "auto", "DOP853" and "Rodas5P" choose
            their steps, as does an `Adaptive` with other tolerances; others, such as "RK4", have a fixed step.
        step_s: Step of a method of fixed step, in [s], 1 ms by default. Steps are shorter where samples, ticks,
            switches or the end of the run require it. A method that chooses its steps takes no step_s.
        record_every_s: Time between samples; 0 for every step, or 1000 samples where the method chooses its steps.
        estimate_error: True to estimate the error by companion runs. They take one to two times as long as the run,
            or five times as long if only shorter steps can show the error.
        metadata: Texts stored with the run.
        engine: "interpreted"; "compiled", which runs as machine code, with right angles of the file to all digits of
            float64; or "auto", which compiles if that saves time, and uses machine code that exists already.
        events: Events to locate. A step ends at each of them, and a terminal event ends the run.
        accuracy: Largest permitted error of q over joints and times: one number for rad and m, or a number for each
            unit, for example {"rad": 1e-8, "m": 1e-6}; the smallest applies. Pilot runs choose method and
            tolerance; the error estimate checks the result.
    """

    plant: Plant
    q0: np.ndarray
    v0: np.ndarray = None  # pyright: ignore[reportAssignmentType] # zeros once built
    duration_s: float = 1.0
    controller: Controller | None = None
    method: Integrator | Adaptive = AUTO  # pyright: ignore[reportAssignmentType]
    step_s: float | None = None
    record_every_s: float = 0.0
    estimate_error: bool = True
    metadata: dict[str, str] = field(default_factory=dict, repr=False)
    engine: str = "auto"
    events: tuple[Event, ...] = ()
    accuracy: float | None = None

    if TYPE_CHECKING:  # arguments that `__post_init__` converts to the types of the attributes

        def __init__(
            self, plant: Plant, q0: JointValues, v0: JointValues | None = None, **options: Unpack[Options]
        ) -> None: ...

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
            self._check_accuracy(self.accuracy)
        for text in (
            text for pair in instance("metadata", self.metadata, dict, "give texts by name").items() for text in pair
        ):
            instance("metadata", text, str, "give texts by name")
        object.__setattr__(self, "metadata", dict(self.metadata))
        if self.method.controls_error and self.step_s is not None:
            raise QueryError(no_step(self.method.name))
        choice("engine", self.engine, ENGINES)
        object.__setattr__(self, "events", _events(self.events))
        object.__setattr__(self, "controller", _controller(self.controller, len(names)))
        if self.controller is not None:
            check_model(self.plant.dynamics, self.controller, self.q0)
        _check_segments(self)
        check_method(self.plant, self.method, self.events, self.finds_events)
        check_start(self.plant, self.controller, self.events, self.q0, self.v0)

    def _check_accuracy(self, accuracy: Accuracy) -> None:
        """Check the requested accuracy, and that no other option chooses the method or the tolerance."""
        object.__setattr__(self, "accuracy", least_accuracy(accuracy, self.plant.dynamics))
        if self.method != Adaptive(AUTO):
            name = self.method.name
            raise QueryError(f"accuracy: chooses method and tolerances; leave out method, rtol and atol, got {name!r}")
        if not self.estimate_error:
            raise QueryError("accuracy: is checked by the error estimate; leave out estimate_error=False")

    def __repr__(self) -> str:
        return f"<Setup: {explanation_of(self)}>"

    def _repr_html_(self) -> str:
        return explanation_of(self)._repr_html_()

    def __getstate__(self) -> tuple[dict[str, object], tuple[str, ...]]:
        state, frozen = super().__getstate__()
        return {field.name: state[field.name] for field in fields(self)}, frozen

    @cached_property
    def is_value(self) -> bool:
        """True if no part, events excepted, is user-defined code or may change; derived values then remain valid."""
        return all(map(is_value, (self.plant, self.controller, self.method)))

    @cached_property
    def equation(self) -> StateEquation:
        """The state equation of the run."""
        return StateEquation(self.plant, self.controller, self.method.canonical, self.events)

    @cached_property
    def undeclared(self) -> tuple[tuple[object, str], ...]:
        """The parts that lack a declaration, each with the words for it; see `declarations.undeclared`."""
        return undeclared(self.plant, self.controller)

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The run, divided at the ticks of the controller, the breaks of its references and the switches of effects.

        Raises:
            QueryError: If two switches are too close for floats to resolve.
        """
        starts, step = self._cuts[:-1], self.nominal_step_s
        ends = [t for t, _ in self._cuts[1:]]
        counts = [
            steps_on(end - start, step, self.record_every_s) for (start, _), end in zip(starts, ends, strict=True)
        ]
        few = sum(count < LEAST_STEPS for count in counts)
        if LEAST_STEPS * few <= sum(counts) / 10:  # a companion run needs them to take longer steps
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
        """True if the controller acts at the end of the run."""
        return self._cuts[-1][1]

    @property
    def finds_events(self) -> bool:
        """True if steps end at thresholds of effects and of the controller, and at requested events."""
        if self.method.controls_error or self.method.nonsmooth:
            return not self.method.nonsmooth
        return self.equation.switches and self.steps <= MOST_CUT

    @property
    def samples_on_steps(self) -> bool:
        """True if each sample of a method of fixed step lies at the end of a step of the schedule."""
        if not self.record_every_s:
            return True
        ends, due = nodes(self.segments), np.arange(0.0, self.duration_s, self.record_every_s)
        return bool((np.abs(near(ends, due) - due) <= ON_STEP * self.nominal_step_s).all())

    @property
    def steps(self) -> int:
        """Number of steps of a method of fixed step, without those that events add."""
        return self.segments[-1].first + self.segments[-1].steps

    @property
    def nominal_step_s(self) -> float:
        """Step of a method of fixed step before samples, ticks and switches shorten it, in [s]."""
        return STEP_S if self.step_s is None else self.step_s

    @property
    def taken_step_s(self) -> float:
        """Longest step that a method of fixed step takes, in [s]: at most `nominal_step_s` and `record_every_s`."""
        return max((x.end - x.start) / x.steps for x in self.segments)

    @property
    def longest_step_s(self) -> float:
        """Longest step that an adaptive method may take, in [s]; inf if all parts declare where they switch.

        A part without this declaration may act briefly within a step; error control misses it if no stage falls there.
        With such a part, the limit is 10 ms or 1/200 of the run, whichever is shorter.
        """
        longest = min(_LONGEST_STEP_S, self.duration_s / _LEAST_STEPS)
        return longest if self.undeclared else inf


def no_step(name: str) -> str:
    """Return the error message for step_s with a method that chooses its steps."""
    return (
        f"step_s has no effect on {name}, which chooses its steps: leave it out, name a method of fixed step like"
        " method='RK4', or give rd.integrate.Adaptive(max_step_s=…)"
    )


def _events(events: Any) -> tuple[Event, ...]:
    """Return one event or several as a tuple; raise QueryError if they are not events."""
    events = (events,) if isinstance(events, Event) else events
    if not isinstance(events, tuple | list):
        raise QueryError(f"events: give a list of rd.Event, got {shown(events)}")
    return tuple(instance("events", event, Event, "give a list of rd.Event") for event in events)


def _controller(controller: Any, n: int) -> Controller | None:
    """Return a controller of n joints; a function becomes a `ControlLaw`. Raise QueryError if it is neither."""
    if callable(controller) and not isinstance(controller, Controller) and not isinstance(controller, type):
        controller = ControlLaw(controller, n)
    controller = instance(
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
    """Check that a run does not have too many steps, ticks or switches, and that floats resolve its times.

    Raises:
        QueryError: If it does not pass; with the number and the remedy.
    """
    cut = segments(setup)
    size = cut * (_SEGMENT_BYTES + _SEGMENT_BYTES_PER_JOINT * setup.plant.dynamics.n)
    if size > MOST_BYTES:
        raise QueryError(
            f"a run of {setup.duration_s:g} s with {cut:.3g} ticks and switches takes {gibibytes(size)}, more than "
            f"{gibibytes(MOST_BYTES)}: use a longer period_s of the controller, or a shorter duration_s"
        )
    if steps(setup) > MOST_STEPS:
        raise QueryError(
            f"a run of {setup.duration_s:g} s takes {steps(setup):.3g} steps of step_s = {setup.nominal_step_s:g} s,"
            f" more than {MOST_STEPS:g}: use a longer step_s, or a shorter duration_s"
        )
    if setup.duration_s > LONGEST_S:
        raise QueryError(
            f"a run of {setup.duration_s:g} s ends at a time that floats resolve to {ulp(setup.duration_s):.1g} s only:"
            f" use a shorter duration_s, {LONGEST_S:.2g} s at most"
        )


def segments(setup: Setup) -> float:
    """Return an upper bound of the number of segments between ticks, breaks and switches."""
    controller = setup.controller
    period = controller.period_s / len(controller.instants) if controller else 0.0
    cuts = sum(len(effect.switches) for effect in setup.plant.effects) + len(controller.knots if controller else ())
    return 2.0 + cuts + (setup.duration_s / period if period > 0 else 0.0)


def steps(setup: Setup) -> float:
    """Return the approximate number of steps of a method of fixed step; 0 for an adaptive method."""
    if setup.method.controls_error:
        return 0.0
    step = min(setup.nominal_step_s, setup.record_every_s or inf)  # samples lie on steps
    return setup.duration_s / step + 4 * segments(setup)


def gibibytes(size: float) -> str:
    """Return a number of bytes as text, in GiB."""
    return f"{size / 2**30:.3g} GiB"


def check_record(setup: Setup) -> None:
    """Check that the samples of a run take at most MOST_BYTES.

    Raises:
        QueryError: If they take more; with the size and the remedy.
    """
    equation = setup.equation
    n, s, m = equation.plant.dynamics.n, len(equation.sources), len(equation.widths)
    # t, y, zero-order hold; q, v, a, u, work, power, energies; q_d, tracking error; twice, for temporary copies
    size = 2 * 8 * samples(setup) * (1 + m + n + 4 * n + 2 * s + 2 + 2 * n)
    if size > MOST_BYTES:
        raise too_large(f"{samples(setup):.3g} samples", size, MOST_BYTES)


def check_batch(setup: Setup, runs: int, numbers: int, most: float) -> None:
    """Check that the samples of a batch, of `numbers` numbers each, take at most `most` bytes.

    Raises:
        QueryError: If they take more; with the size and the remedy.
    """
    size = 8 * samples(setup) * runs * numbers
    if size > most:
        raise too_large(
            f"at most {samples(setup):.3g} samples of {runs} runs", size, most, ", fewer runs, or record less"
        )


def too_large(record: str, size: float, most: float, or_else: str = "") -> QueryError:
    """Return the error for a record of more than `most` bytes."""
    remedy = f"use a longer record_every_s or a shorter duration_s{or_else}"
    return QueryError(f"recording {record} takes {gibibytes(size)}, more than {gibibytes(most)}: {remedy}")


def samples(setup: Setup) -> float:
    """Return an upper bound of the number of samples."""
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
    """Return the words for the longest step taken, if it is shorter than the nominal step; else empty."""
    taken = setup.taken_step_s
    if taken >= setup.nominal_step_s * (1 - 1e-9):
        return ""
    return f", in fact {taken:.6g} at most: steps end at samples, ticks and switches"


def _method(setup: Setup) -> Iterator[str]:
    method, name = setup.method, setup.method.name
    used: dict[str, Any] = {}
    if setup.accuracy is not None:
        name = f"chosen for an error of q of at most {setup.accuracy:g}"
    elif isinstance(method, Adaptive):
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
