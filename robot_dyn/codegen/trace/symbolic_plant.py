"""A plant and its controller in symbols: effects, bounds and control laws, for every outcome of their branches.

Each part is wrapped in a part of the same kind, which traces its results and names it in errors. References and models
of a controller are identified by their types, not by the names of its attributes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, Protocol, final

import numpy as np

from robot_dyn.codegen.parameters import CONTROLLER, Values
from robot_dyn.codegen.trace.symbolic import Symbol, Symbols, TraceError, column, every_branch
from robot_dyn.control.controller import Controller
from robot_dyn.control.reference import PiecewisePolynomial, polynomial
from robot_dyn.effects.carried_payload import CarriedPayload
from robot_dyn.effects.effect import Active, Bound, Conservative, Drive, Effect, Stateful
from robot_dyn.effects.plant import Plant
from robot_dyn.effects.set_valued import Mode, SetValued
from robot_dyn.foundations.arithmetic import Array, Scalar
from robot_dyn.foundations.coefficients import with_values
from robot_dyn.foundations.errors import QueryError, located_message
from robot_dyn.queries.dynamics import Dynamics

_INTERPRETED = "use the plant itself, or simulate it"
REMEDY = "write it with robot_dyn.foundations.arithmetic and NumPy's operators, or use engine='interpreted'"
_ARM_INSIDE = "a robot inside a function cannot be traced; use engine='interpreted'"
_ARM_INSIDE_A_LAW = (
    "a robot inside a function cannot be traced: make it an attribute of a rd.control.Stateless controller, or use"
    " engine='interpreted'"
)


def symbolic_plant(plant: Plant, bodies: Dynamics, values: Values | None = None) -> Plant:
    """Return the same plant in symbols.

    Args:
        plant: Plant to trace.
        bodies: Rigid bodies of the plant, a `SymbolicDynamics`.
        values: Symbols for the parameters of its effects; constants otherwise.
    """
    values = values or {}
    return Plant(bodies, [_traced(effect, values.get(("effect", i), {})) for i, effect in enumerate(plant.effects)])


def symbolic_controller(
    controller: Controller, models: Mapping[str, Dynamics], values: Values, pieces: Sequence[Motion]
) -> Controller:
    """Return the same controller in symbols.

    Args:
        controller: Controller to trace.
        models: Models of the robot in symbols, by attribute of the controller.
        values: Symbols for the parameters of the controller and its references.
        pieces: Motions of its references, for example their polynomials on a segment.
    """
    parts: dict[str, Any] = dict(values.get(CONTROLLER, {})) | dict(models)
    remaining = iter(pieces)
    for name, reference in controller.references.items():
        whole = reference.polynomials.get("")
        if whole is not None and type(whole).at is not PiecewisePolynomial.at:
            raise TraceError(
                f"reference {type(reference).__name__} cannot be compiled: its at(t) differs from its polynomials;"
                " use an rd.control.PiecewisePolynomial, or engine='interpreted'"
            )
        polynomials = {attribute: next(remaining) for attribute in reference.polynomials}
        attributes = polynomials | dict(values.get(("reference", name), {}))
        parts[name] = polynomials.get("") or with_values(reference, attributes)
    return TracedController(with_values(controller, parts), controller)


def wide(x: object, n: int) -> np.ndarray:
    """Broadcast a number, or (n,), to symbols (n,)."""
    return np.broadcast_to(np.asarray(x, dtype=object), (n,)).view(Symbols)


def whichever_way(name: str, function: Callable[[], Array], of_arm_inside: str = _ARM_INSIDE) -> Symbols:
    """Return the result of a part for every outcome of its comparisons; TraceError names the part.

    `of_arm_inside` is the remedy if the part uses a robot that it does not declare.
    """
    try:
        result = every_branch(function).view(Symbols)
        column(result)  # raises if an entry is not a number
        return result
    except Exception as error:  # user code can raise anything on symbols
        has_robot = isinstance(error, QueryError) and Symbol.__name__ in str(error)  # a query with symbols
        remedy = of_arm_inside if has_robot else REMEDY
        raise TraceError(f"{name} cannot be compiled ({located_message(error)}): {remedy}") from error


class Motion(Protocol):
    """A motion in symbols, instead of a piecewise polynomial of a reference."""

    def at(self, t: Symbol, /) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration at t."""
        ...


@final
class Piece:
    """A polynomial of a reference whose coefficients are inputs: start time and c₀, c₁, …, each (n,)."""

    def __init__(self, p: Array, n: int) -> None:
        self.start, self.coefficients = p[0], p[1:].reshape(-1, n).view(Symbols)

    def at(self, t: Symbol) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration."""
        return polynomial(self.coefficients, t - self.start)


def _traced(effect: Effect, values: Mapping[str, Scalar]) -> Effect:
    if isinstance(effect, CarriedPayload):
        if effect.carried is None:
            raise TraceError(f"effect {effect.name} is temporary: use plant.at(t), t in [s], or simulate the plant")
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


def _inner(name: str) -> Any:
    """Return a property with the attribute of the wrapped effect."""
    return property(lambda self: getattr(self.inner, name))


def _method(name: str, length: Callable[..., int]) -> Any:
    """Return a traced method of the wrapped part; `length` computes the length of its result from its arguments."""

    def traced(self: Any, *arguments: Any) -> Array:
        """Return the result of the wrapped part in symbols."""
        return self.traced(lambda: getattr(self.inner, name)(*arguments), length(*arguments))

    return traced


class _Part:
    """An effect that is traced for every outcome of its branches."""

    name = _inner("name")

    def __init__(self, inner: Any) -> None:
        self.inner = inner

    def traced(self, function: Callable[[], object], length: int) -> Array:
        """Return a result as symbols (length,)."""
        return whichever_way(f"effect {self.name}", lambda: wide(function(), length))


class _Torque(_Part):
    """Torque of a force."""

    torque = _method("torque", lambda dynamics, *_: dynamics.n)


class _TracedForce(_Torque, Active):
    """A traced torque."""


class _TracedSetValued(_Torque, SetValued):
    """A traced effect that may hold joints, in a mode."""

    has_friction, stops, at_rest = map(_inner, ("has_friction", "stops", "at_rest"))
    friction = _method("friction", len)

    @property
    def held(self) -> Array:  # pyright: ignore[reportIncompatibleVariableOverride]  read only
        """1 for each held joint."""
        if self.inner.held is None:
            raise TraceError(f"effect {self.name} holds joints, and only a run determines which ones: {_INTERPRETED}")
        return self.inner.held

    def bounds(self, q: Array, v: Array) -> tuple[Array, Array]:
        n = len(v)
        both = self.traced(lambda: np.concatenate([wide(x, n) for x in self.inner.bounds(q, v)]), 2 * n)
        return both[:n], both[n:]

    def in_mode(self, mode: Mode) -> SetValued:
        return _TracedSetValued(self.inner.in_mode(mode))


class _TracedConservative(_Torque, Conservative):
    """A traced torque with a potential."""

    def potential(self, dynamics: Any, t: Any, q: Array) -> Any:
        return self.traced(lambda: self.inner.potential(dynamics, t, q), 1)[0]


class _TracedBound(_Part, Bound):
    """A traced bound on the actuation."""

    actuation, limited = (_method(name, lambda u, *_: len(u)) for name in ("actuation", "limited"))
    of_velocity = _inner("of_velocity")


class _States(_Part, Stateful):
    """States of a traced effect."""

    state_size, start = map(_inner, ("state_size", "start"))
    state_rate = _method("state_rate", lambda dynamics, t, q, v, u, z, *_: len(z))


class _StatefulForce(_States, _TracedForce):
    """A traced torque with states."""


class _TracedDrive(_StatefulForce, Drive):
    """A traced drive."""

    driven, coupled, speeds = map(_inner, ("driven", "coupled", "speeds"))
    direct_actuation, added_inertia, power = map(_inner, ("direct_actuation", "added_inertia", "power"))


class _TracedSetValuedDrive(_TracedDrive, _TracedSetValued):
    """A traced drive with a mode."""

    drag = _inner("drag")


class _StatefulBound(_States, _TracedBound):
    """A traced bound with states."""


@final
class TracedController(Controller):
    """A traced controller."""

    def __init__(self, inner: Controller, original: Controller) -> None:
        self.inner, self.original, self.period_s = inner, original, original.period_s

    @cached_property
    def n(self) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Number of joints."""
        return self.original.n

    @cached_property
    def state_size(self) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Number of states of the controller."""
        return self.original.state_size

    torque, demand = (_method(name, lambda t, q, v, z: len(v)) for name in ("torque", "demand"))
    state_rate, next_state = (_method(name, lambda t, q, v, z: len(z)) for name in ("state_rate", "next_state"))

    def traced(self, function: Callable[[], object], length: int) -> Array:
        """Return a result as symbols (length,)."""
        return whichever_way(f"controller {self.original.name}", lambda: wide(function(), length), _ARM_INSIDE_A_LAW)
