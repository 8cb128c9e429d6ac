"""Base classes of effects: an effect is a torque τ_effect(t, q, v) on the joints, so that N = ∂V/∂q − Σ τ_effect.

Its class declares what it does to the energy, and a contract test checks that. A plant evaluates only its own effects.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Any, ClassVar

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.coefficients import check_coefficients, declared
from robot_dyn.errors import EffectError, QueryError
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.threshold import Threshold, smooth
from robot_dyn.validate import rows
from robot_dyn.values import Value


class Effect(Value):
    """Something that acts on the joints: a `Force`, a `Bound`, or several of them as its `parts`.

    Subclass one of the four kinds below. Its methods are pure functions, called with

        dynamics: the rigid bodies of the plant, a `Dynamics`
        t: time, a number, in [s]
        q: position, (..., n), in [rad] or [m] by joint
        v: velocity, (..., n), in [rad/s] or [m/s]

    and with symbols in place of these numbers where it is compiled: written in `robot_dyn.arithmetic` and NumPy's
    operators it runs in both engines.

    Coefficients that are declared (`robot_dyn.coefficients`) are checked on construction, may be given by joint name,
    or as "urdf" where files state them, and may be swept.

    Attributes:
        term: Its equation in short, for `explain`.
    """

    term: ClassVar[str] = ""

    def __post_init__(self) -> None:
        check_coefficients(self, EffectError, resolved=True)

    @property
    def name(self) -> str:
        """Its name in scenes and ledgers: that of its class, in snake case."""
        return re.sub(r"(?<!^)(?=[A-Z])", "_", type(self).__name__).lower()

    def on(self, dynamics: Any) -> Effect:
        """Return this effect with arrays (n,) for coefficients that are given by joint name or as "urdf".

        Raises:
            EffectError: If a joint is unknown, no file states the coefficient, or one is of another number of joints.
        """
        known = {
            key: each.on(f"{self.name}: {key}", getattr(self, key), dynamics)
            for key, each in declared(type(self)).items()
        }
        changed: Any = {key: value for key, value in known.items() if value is not getattr(self, key)}
        return replace(self, **changed) if changed else self  # pyright: ignore[reportArgumentType]  a dataclass

    @property
    def parts(self) -> tuple[Effect, ...]:
        """The forces and bounds that it consists of; by default itself."""
        return (self,)

    @property
    def switches(self) -> tuple[float, ...]:
        """Times in [s] at which it starts or stops: a step of integration ends there."""
        return ()

    def thresholds(self, n: int) -> tuple[Threshold, ...]:
        """Where it switches from one smooth formula to another, on an arm of n joints; () if it is smooth everywhere.

        A step of integration ends where one is passed; `on_side` returns the effect on either side. A class that does
        not define this declares nothing: it runs interpreted unless machine code is requested, and error estimates do
        not rest on the order of a method. Levels of the actuation are for bounds: of what reaches them.
        """
        return ()

    def on_side(self, n: int, sides: Mapping[Threshold, int]) -> Effect:
        """Return the effect with each threshold passed (1) or not (−1), extended smoothly to all q and v."""
        return self

    @property
    def widths(self) -> tuple[Any, Any]:
        """Changes of q and of v over which its torque bends, each a scalar or (n,); inf where it is smooth.

        An implicit method takes its Jacobian from differences inside them. Where v reverses within a few steps through
        such a layer about 0, an error estimate does not rest on the order of the method.
        """
        return inf, inf


class Force(Effect, ABC):
    """An effect that is a torque on the joints, besides actuation and gravity."""

    @abstractmethod
    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        """The torque this effect exerts on the joints, shape (..., n), in [N m] or [N]."""


class Conservative(Force):
    """An effect with a potential E(t, q), which the energy ledger counts: torque = −∂E/∂q. Contract as of `Effect`."""

    @abstractmethod
    def potential(self, dynamics: Dynamics, t: float, q: Array) -> Array:
        """Its energy E(t, q), shape (...), in [J]."""


class Dissipative(Force):
    """An effect that never adds energy: torqueᵀ v ≤ 0 at all t, q, v. Contract as of `Effect`."""


class Active(Force):
    """An effect whose power torqueᵀ v may have either sign. Contract as of `Effect`."""


class Stateful(Effect, ABC):
    """An effect with states z, ż = rate(t, q, v, u, z), which are integrated with the plant.

    A subclass is also of another kind. The torque of such a force is torque(dynamics, t, q, v, z), and the actuation
    that such a bound leaves is actuation(u, z). A dissipative one obeys torqueᵀ v + dE/dt ≤ 0, with E the energy that
    its states store. Queries of a plant at one state use the initial z, and leave the actuation unchanged.
    """

    @abstractmethod
    def state_size(self, n: int) -> int:
        """Number of its states on an arm of n joints."""

    def start(self, dynamics: Dynamics, q: Array, v: Array) -> Array:
        """Return its states at the start of a run from q, v, (..., n), shape (..., state_size); 0 by default."""
        shape = (*v.shape[:-1], self.state_size(dynamics.n))
        return np.zeros(shape, dtype=v.dtype).view(type(v))

    @abstractmethod
    def state_rate(self, dynamics: Dynamics, t: float, q: Array, v: Array, u: Array, z: Array) -> Array:
        """ż, (state_size,), in the unit of z per s.

        Args:
            dynamics: As of `Effect`, as are t, q and v, of one state.
            t: Time.
            q: Position.
            v: Velocity.
            u: The actuation, (n,), in [N m] or [N]; for a bound, after the bounds before it.
            z: Its states, (state_size,).
        """

    def stored_energy(self, dynamics: Dynamics, t: float, q: Array, z: Array) -> Array:
        """Energy E stored in its states, in [J], for the ledger; 0 by default."""
        return 0 * q[..., 0]


class Drive(Stateful, Force, ABC):
    """A force with states whose motors take the actuation of some joints in place of these joints.

    Its work in the ledger is that of its torque on the joints less that of the actuation on its motors.
    """

    @abstractmethod
    def driven(self, n: int) -> Sequence[int]:
        """Indices of the joints whose actuation it takes, on an arm of n joints."""

    coupled: ClassVar[bool] = False  # whether its motors may move with their joints: state_rate then takes a as well

    @abstractmethod
    def speeds(self, z: Array) -> Array:
        """Velocities at which the actuation of these joints works, in the order of `driven`."""

    def reaching(self, u: Array) -> Array:
        """The part of the actuation u, (..., n), that acts on these joints; 0 by default."""
        return 0 * u[..., list(self.driven(u.shape[-1]))]

    def added_inertia(self, n: int) -> Array:
        """Inertia of motors that move with these joints; 0 by default."""
        return np.zeros(len(self.driven(n)))

    def power(self, v: Array, u: Array, torque: Array, z: Array, a: Array) -> Array:
        """Its power at one state: velocity, actuation, its torque, its states, acceleration."""
        return torque @ v - u[list(self.driven(len(v)))] @ self.speeds(z)


class Bound(Effect, ABC):
    """An effect that bounds the actuation, by the order of a plant's effects. Contract as of `Effect`."""

    @abstractmethod
    def actuation(self, u: Array) -> Array:
        """Return the bounded actuation for u, (..., n), in [N m] or [N]."""


class Timed(Effect):
    """An effect that is smooth but acts only from its field `start_s` until its field `end_s`, in [s]."""

    start_s: float
    end_s: float

    thresholds = smooth

    def __post_init__(self) -> None:
        super().__post_init__()
        require("end_s must lie after start_s", lambda start, end: start < end, self.start_s, self.end_s)

    @property
    def switches(self) -> tuple[float, ...]:
        return self.start_s, self.end_s

    def acts(self, t: Any) -> Array:
        """Whether it acts at times t (...,), at `start_s` already and at `end_s` no longer."""
        t = rows("t", t)
        return (self.start_s <= t) & (t < self.end_s)


def require(message: str, relation: Callable[..., Any], *values: Any) -> None:
    """Raise an EffectError unless coefficients satisfy a relation for every joint.

    Values by joint name or "urdf" are checked when a plant knows the joints, as are different numbers of joints.
    """
    if not all(isinstance(x, float | np.ndarray) for x in values):
        return
    try:
        satisfied = np.all(relation(*values))
    except ValueError:  # of different numbers of joints
        return
    if not satisfied:
        raise EffectError(f"{message}, got {' and '.join(map(str, values))}")


def check_frame(effect: Effect, dynamics: Any, frame: str) -> None:
    """Raise an EffectError if the arm has no such frame."""
    try:
        dynamics.placement(np.zeros(dynamics.n), frame)
    except QueryError as error:
        raise EffectError(f"{effect.name}: {error}") from None
