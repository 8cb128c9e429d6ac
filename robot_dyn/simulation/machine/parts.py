"""The parts of a state equation on symbols: effects, bounds, controllers, references, whichever way they branch.

Each wraps the part it traces, and names it where that cannot be traced.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.compiled.symbolic import Symbols, TraceError, every_branch
from robot_dyn.control.controller import Controller
from robot_dyn.effects.effect import Active, Bound, Conservative
from robot_dyn.foreign import because

REMEDY = "write it in robot_dyn.arithmetic and NumPy's operators, or take engine='interpreted'"


def with_(part: Any, values: Mapping[str, Any]) -> Any:
    """A copy of a part with other values, which its own checks would not take."""
    if not values:
        return part
    made = copy(part)
    for name, value in values.items():
        object.__setattr__(made, name, value)
    return made


def wide(x: Any, n: int) -> np.ndarray:
    """Symbols (n,) of a number or (n,)."""
    return np.broadcast_to(np.asarray(x, dtype=object), (n,)).view(Symbols)


def _followed(name: str, function: Callable[[], Any]) -> Any:
    """What a part gives, whichever way its comparisons turn out; TraceError names the part."""
    try:
        return every_branch(function).view(Symbols)
    except Exception as error:  # whatever a user's code raises on symbols
        raise TraceError(f"{name} cannot be compiled ({because(error)}): {REMEDY}") from error


@final
class Piece:
    """One polynomial of a reference, of coefficients that are inputs."""

    def __init__(self, p: Array, n: int) -> None:
        self.n, self.start, self.coefficients = n, p[0], p[1:].reshape(-1, n).view(Symbols)

    def at(self, t: Any) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration, by the lines of `PiecewisePolynomial.at`."""
        s, c = t - self.start, self.coefficients
        q = c[-1] + 0 * s
        v = a = 0 * q
        for j in reversed(range(len(c) - 1)):
            a = a * s + v
            v = v * s + q
            q = q * s + c[j]
        return q, v, 2 * a


class TracedForce(Active):
    """A torque, traced whichever way it branches."""

    def __init__(self, force: Any) -> None:
        self.inner = force

    def torque(self, dynamics: Any, t: Any, q: Array, v: Array) -> Array:
        name = f"effect {self.inner.name}"
        return _followed(name, lambda: wide(self.inner.torque(dynamics, t, q, v), dynamics.n))


class TracedConservative(Conservative):
    """The same with its potential."""

    def __init__(self, force: Any) -> None:
        self.inner = force

    torque = TracedForce.torque

    def potential(self, dynamics: Any, t: Any, q: Array) -> Any:
        return _followed(f"effect {self.inner.name}", lambda: wide(self.inner.potential(dynamics, t, q), 1))[0]


class TracedBound(Bound):
    """A bound on the actuation, traced likewise."""

    def __init__(self, bound: Any) -> None:
        self.inner = bound

    def actuation(self, u: Array) -> Array:
        return _followed(f"effect {self.inner.name}", lambda: wide(self.inner.actuation(u), len(u)))


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

    def state_rate(self, t: Any, q: Array, v: Array, z: Array) -> Array:
        return self._traced(lambda: self.inner.state_rate(t, q, v, z), self.state_size)

    def next_state(self, t: Any, q: Array, v: Array, z: Array) -> Array:
        return self._traced(lambda: self.inner.next_state(t, q, v, z), self.state_size)

    def _traced(self, function: Callable[[], Any], length: int) -> Array:
        return _followed(f"controller {self.original.name}", lambda: wide(function(), length))
