"""A plant and its controller in symbols: effects, bounds and control laws, whichever way they branch.

Each wraps the part it traces, and names it where that cannot be traced. What a controller follows and its models of
the arm are found by what they are, whatever its attributes are called.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.codegen.parameters import CONTROLLER, Part
from robot_dyn.codegen.trace.symbolic import Symbols, TraceError, column, every_branch
from robot_dyn.coefficients import with_values
from robot_dyn.control.controller import Controller
from robot_dyn.control.reference import PiecewisePolynomial, polynomial
from robot_dyn.effects.carried_payload import CarriedPayload
from robot_dyn.effects.effect import Active, Bound, Conservative, Drive, Effect, Stateful
from robot_dyn.effects.plant import Plant
from robot_dyn.effects.set_valued import Interval, Mode, SetValued
from robot_dyn.errors import because

_INTERPRETED = "ask the plant itself, or simulate it"
REMEDY = "write it in robot_dyn.arithmetic and NumPy's operators, or take engine='interpreted'"


def symbolic_plant(plant: Plant, bodies: Any, values: Mapping[Part, Mapping[str, Array]] | None = None) -> Plant:
    """The same plant in symbols.

    Args:
        plant: What to trace.
        bodies: Its rigid bodies, a `SymbolicDynamics`.
        values: Symbols for the parameters of its effects; constants otherwise.
    """
    values = values or {}
    return Plant(bodies, [_traced(each, values.get(("effect", i), {})) for i, each in enumerate(plant.effects)])


def symbolic_controller(
    controller: Controller, models: Mapping[str, Any], values: Mapping[Part, Mapping[str, Array]], pieces: Sequence[Any]
) -> Controller:
    """The same controller in symbols.

    Args:
        controller: What to trace.
        models: Its models of the arm in symbols, by attribute.
        values: Symbols for its parameters, and those of its references.
        pieces: The polynomials that its references are made of on a segment.
    """
    made: dict[str, Any] = dict(values.get(CONTROLLER, {})) | dict(models)
    left = list(pieces)
    for name, reference in controller.references.items():
        if isinstance(reference, PiecewisePolynomial) and type(reference).at is not PiecewisePolynomial.at:
            raise TraceError(
                f"reference {type(reference).__name__} cannot be compiled: its at(t) is not that of its polynomials;"
                " give an rd.PiecewisePolynomial, or take engine='interpreted'"
            )
        own = {attribute: left.pop(0) for attribute in reference.polynomials}
        made[name] = own.get("") or with_values(reference, own | dict(values.get(("reference", name), {})))
    return TracedController(with_values(controller, made), controller)


def wide(x: Any, n: int) -> np.ndarray:
    """Symbols (n,) of a number or (n,)."""
    return np.broadcast_to(np.asarray(x, dtype=object), (n,)).view(Symbols)


def whichever_way(name: str, function: Callable[[], Any]) -> Any:
    """What a part gives, whichever way its comparisons turn out; TraceError names the part."""
    try:
        made = every_branch(function).view(Symbols)
        column(made)  # reports what is not a number
        return made
    except Exception as error:  # whatever a user's code raises on symbols
        raise TraceError(f"{name} cannot be compiled ({because(error)}): {REMEDY}") from error


@final
class Piece:
    """One polynomial of a reference, of coefficients that are inputs: its first time and c₀, c₁, …, each (n,)."""

    def __init__(self, p: Array, n: int) -> None:
        self.start, self.coefficients = p[0], p[1:].reshape(-1, n).view(Symbols)

    def at(self, t: Any) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration."""
        return polynomial(self.coefficients, t - self.start)


def _traced(effect: Effect, values: Mapping[str, Array]) -> Effect:
    if isinstance(effect, CarriedPayload):
        if effect.carried is None:
            raise TraceError(f"effect {effect.name} comes and goes: ask plant.at(t), t in [s], or simulate the plant")
        return effect
    own: Any = with_values(effect, values)
    if isinstance(effect, Drive):
        return _TracedSetValuedDrive(own) if isinstance(effect, SetValued) else _TracedDrive(own)
    if isinstance(effect, SetValued):
        return _TracedSetValued(own)
    if isinstance(effect, Stateful):
        return _StatefulBound(own) if isinstance(effect, Bound) else _StatefulForce(own)
    if isinstance(effect, Bound):
        return _TracedBound(own)
    return _TracedConservative(own) if isinstance(effect, Conservative) else _TracedForce(own)


class _Part:
    """An effect that is traced whichever way it branches."""

    def __init__(self, inner: Any) -> None:
        self.inner = inner

    @property
    def name(self) -> str:
        return self.inner.name

    def traced(self, function: Callable[[], Any], length: int) -> Array:
        """Symbols (length,) of what it gives."""
        return whichever_way(f"effect {self.name}", lambda: wide(function(), length))


class _Torque(_Part):
    """The torque of a force."""

    def torque(self, dynamics: Any, t: Any, q: Array, v: Array, *z: Array) -> Array:
        return self.traced(lambda: self.inner.torque(dynamics, t, q, v, *z), dynamics.n)


class _TracedForce(_Torque, Active):
    """A torque."""


class _TracedSetValued(_Torque, SetValued):
    """An effect that may hold joints, in a mode."""

    @property
    def held(self) -> Any:
        """1 for each joint that is held."""
        if self.inner.held is None:
            raise TraceError(f"effect {self.name} holds joints, and which ones a run finds out: {_INTERPRETED}")
        return self.inner.held

    @property
    def rubs(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Whether it is friction."""
        return self.inner.rubs

    @property
    def stops(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Whether it bounds velocities."""
        return self.inner.stops

    def friction(self, v: Array) -> Array:
        return self.traced(lambda: self.inner.friction(v), len(v))

    def bounds(self, q: Array, v: Array) -> tuple[Array, Array]:
        n = len(v)
        both = self.traced(lambda: np.concatenate([wide(x, n) for x in self.inner.bounds(q, v)]), 2 * n)
        return both[:n], both[n:]

    def in_mode(self, mode: Mode) -> SetValued:
        return _TracedSetValued(self.inner.in_mode(mode))

    def at_rest(self, q: np.ndarray) -> Interval:
        return self.inner.at_rest(q)


class _TracedConservative(_Torque, Conservative):
    """A torque with a potential."""

    def potential(self, dynamics: Any, t: Any, q: Array) -> Any:
        return self.traced(lambda: self.inner.potential(dynamics, t, q), 1)[0]


class _TracedBound(_Part, Bound):
    """A bound on the actuation."""

    def actuation(self, u: Array, *z: Array) -> Array:
        return self.traced(lambda: self.inner.actuation(u, *z), len(u))


class _States(_Part, Stateful):
    """The states of an effect."""

    def state_size(self, n: int) -> int:
        return self.inner.state_size(n)

    def start(self, dynamics: Any, q: Array, v: Array) -> Array:
        return self.inner.start(dynamics, q, v)

    def state_rate(self, dynamics: Any, t: Any, q: Array, v: Array, u: Array, z: Array, *a: Array) -> Array:
        return self.traced(lambda: self.inner.state_rate(dynamics, t, q, v, u, z, *a), len(z))


class _StatefulForce(_States, _TracedForce):
    """A torque with states."""


class _TracedDrive(_StatefulForce, Drive):
    """A drive."""

    def driven(self, n: int) -> Sequence[int]:
        return self.inner.driven(n)

    @property
    def coupled(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Whether its motors may move with their joints."""
        return self.inner.coupled

    def speeds(self, z: Array) -> Array:
        return self.inner.speeds(z)

    def reaching(self, u: Array) -> Array:
        return self.inner.reaching(u)

    def added_inertia(self, n: int) -> Array:
        return self.inner.added_inertia(n)

    def power(self, v: Array, u: Array, torque: Array, z: Array, a: Array) -> Array:
        return self.inner.power(v, u, torque, z, a)


class _TracedSetValuedDrive(_TracedDrive, _TracedSetValued):
    """A drive with a mode."""

    def drag(self, n: int, z: Array) -> Array:
        return self.inner.drag(n, z)


class _StatefulBound(_States, _TracedBound):
    """A bound with states."""


@final
class TracedController(Controller):
    """A controller, traced likewise."""

    def __init__(self, inner: Any, original: Controller) -> None:
        self.inner, self.original, self.period_s = inner, original, original.period_s

    @cached_property
    def n(self) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Number of joints."""
        return self.original.n

    @cached_property
    def state_size(self) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Number of states of the controller."""
        return self.original.state_size

    def torque(self, t: Any, q: Array, v: Array, z: Array) -> Array:
        return self._traced(lambda: self.inner.torque(t, q, v, z), self.n)

    def demand(self, t: Any, q: Array, v: Array, z: Array) -> Array:
        return self._traced(lambda: self.inner.demand(t, q, v, z), self.n)

    def state_rate(self, t: Any, q: Array, v: Array, z: Array) -> Array:
        return self._traced(lambda: self.inner.state_rate(t, q, v, z), self.state_size)

    def next_state(self, t: Any, q: Array, v: Array, z: Array) -> Array:
        return self._traced(lambda: self.inner.next_state(t, q, v, z), self.state_size)

    def _traced(self, function: Callable[[], Any], length: int) -> Array:
        return whichever_way(f"controller {self.original.name}", lambda: wide(function(), length))
