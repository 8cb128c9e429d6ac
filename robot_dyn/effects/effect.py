"""Base classes of effects. An effect is a torque τ_effect(t, q, v) on the joints: N = ∂V/∂q − Σ τ_effect.

The class of an effect declares how it changes the energy, and a contract test verifies this. A plant evaluates only
the effects it has.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import count
from math import inf
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from robot_dyn.foundations.arithmetic import Array, Scalar
from robot_dyn.foundations.coefficients import check_coefficients, declared
from robot_dyn.foundations.errors import EffectError, QueryError
from robot_dyn.foundations.threshold import Layer, Threshold, smooth
from robot_dyn.foundations.validate import rows
from robot_dyn.foundations.values import Value
from robot_dyn.queries.dynamics import Dynamics

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class _ClassName:
    """The default name of an effect: the name of its class in snake case."""

    def __get__(self, effect: Effect | None, kind: type[Effect]) -> str:
        return re.sub(r"(?<!^)(?=[A-Z])", "_", kind.__name__).lower()


class Effect(Value):
    """A `Force` on the joints, a `Bound` on the actuation, or a combination of these, its `parts`.

    Subclass `Conservative`, `Dissipative`, `Active` or `Bound`; an effect with states also derives from `Stateful` or
    `Drive`. Methods are pure functions, called with

        dynamics: the rigid bodies of the plant, a `Dynamics`
        t: time, a number, in [s]
        q: position, (..., n), in [rad] or [m] by joint
        v: velocity, (..., n), in [rad/s] or [m/s]

    and with symbols instead of numbers when it is compiled. Methods that use only
    `robot_dyn.foundations.arithmetic` and NumPy's operators run in both engines.

    Declared coefficients (`robot_dyn.foundations.coefficients`) are checked on construction and may be swept. They may
    be given by joint name, or as "urdf" to read them from the robot's file.

    Attributes:
        name: Name in scenes and ledgers: the class name in snake case, unless the class states another.
        term: Equation in short form, for `explain`.
    """

    name: ClassVar[str] = _ClassName()  # pyright: ignore[reportAssignmentType]
    term: ClassVar[str] = ""

    def __post_init__(self) -> None:
        check_coefficients(self, EffectError, allow_unresolved=True)

    def on(self, dynamics: Dynamics) -> Effect:
        """Return this effect with coefficients given by joint name or as "urdf" replaced by arrays (n,).

        Raises:
            EffectError: If a joint is unknown, the file states no value, or the number of joints differs.
        """
        resolved = {
            key: coefficient.on(f"{self.name}: {key}", getattr(self, key), dynamics)
            for key, coefficient in declared(type(self)).items()
        }
        changed: Any = {key: value for key, value in resolved.items() if value is not getattr(self, key)}
        return replace(self, **changed) if changed else self  # pyright: ignore[reportArgumentType]  a dataclass

    @property
    def parts(self) -> tuple[Effect, ...]:
        """The forces and bounds that make up this effect; by default the effect itself."""
        return (self,)

    @property
    def switches(self) -> tuple[float, ...]:
        """Times in [s] at which the effect starts or stops; integration steps end there."""
        return ()

    def thresholds(self, n: int) -> tuple[Threshold, ...]:
        """Thresholds between smooth formulas, on an arm with n joints; () if the effect is smooth everywhere.

        Integration steps end where a threshold is passed; `on_side` returns the effect on either side. If a class does
        not define this method, its smoothness is unknown: it runs interpreted unless machine code is requested, and
        error estimates do not rely on the order of the method. Thresholds on the actuation are for bounds and apply to
        the actuation that enters the bound.
        """
        return ()

    def on_side(self, n: int, sides: Mapping[Threshold, int]) -> Effect:
        """Return the effect with each threshold passed (1) or not (−1), extended smoothly to all q and v."""
        return self

    @property
    def widths(self) -> tuple[Scalar, Scalar]:
        """Changes in q and in v over which the torque bends, each a scalar or (n,); inf where it is smooth.

        Implicit methods compute the Jacobian from differences within these changes. The change in v is also the width
        of a layer around v = 0, see `layers`.
        """
        return inf, inf

    def layers(self, n: int) -> tuple[Layer, ...]:
        """Return the layers in which a smooth torque or rate bends, on an arm with n joints.

        Error estimates do not rely on the order of the method after a step that crosses much of a layer. By default
        the layers are those around v = 0 with the widths of `widths`. Override this method for layers of positions or
        states, or around other velocities.
        """
        width = np.maximum(np.broadcast_to(self.widths[1], n), np.finfo(float).tiny)  # 0, a kink: any step crosses it
        return tuple(Layer(i, float(width[i]), of_velocity=True) for i in range(n) if width[i] < inf)


class Force(Effect, ABC):
    """An effect that exerts a torque on the joints, in addition to actuation and gravity."""

    @abstractmethod
    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        """Return the torque this effect exerts on the joints, shape (..., n), in [N m] or [N]."""


class Conservative(Force):
    """An effect with a potential E(t, q), counted in the energy ledger: torque = −∂E/∂q.

    To write one, define

        def torque(self, dynamics, t, q, v): ...       # −∂E/∂q, (..., n), in [N m] or [N]
        def potential(self, dynamics, t, q): ...       # E(t, q), (...), in [J]

    and `thresholds`, which returns () if it is smooth everywhere. Contract: see `Effect`.
    """

    @abstractmethod
    def potential(self, dynamics: Dynamics, t: float, q: Array) -> Array:
        """Return the potential energy E(t, q), shape (...), in [J]."""


class Dissipative(Force):
    """An effect that never adds energy: torqueᵀ v ≤ 0 at all t, q, v.

    To write one, define

        def torque(self, dynamics, t, q, v): ...       # (..., n), in [N m] or [N]
        def thresholds(self, n): ...                   # () if it is smooth everywhere

    Contract: see `Effect`.
    """


class Active(Force):
    """An effect whose power torqueᵀ v may have either sign.

    To write one, define

        def torque(self, dynamics, t, q, v): ...       # (..., n), in [N m] or [N]
        def thresholds(self, n): ...                   # () if it is smooth everywhere

    Contract: see `Effect`.
    """


class Stateful(Effect, ABC):
    """An effect with states z, ż = rate(t, q, v, u, z), which are integrated with the plant.

    To write one, define

        def state_size(self, n): ...                           # number of states on an arm with n joints
        def state_rate(self, dynamics, t, q, v, u, z): ...     # ż, (state_size,), in the unit of z per second

    A subclass also derives from another kind. A stateful force defines torque(dynamics, t, q, v, z), a stateful bound
    actuation(u, z). A dissipative effect satisfies torqueᵀ v + dE/dt ≤ 0, where E is the energy stored in its states.
    Queries of a plant at one state use the initial z and leave the actuation unchanged.
    """

    @abstractmethod
    def state_size(self, n: int) -> int:
        """Return the number of states on an arm with n joints."""

    def start(self, dynamics: Dynamics, q: Array, v: Array) -> Array:
        """Return the states at the start of a run from q, v, (..., n), shape (..., state_size); 0 by default."""
        shape = (*v.shape[:-1], self.state_size(dynamics.n))
        return np.zeros(shape, dtype=v.dtype).view(type(v))

    @abstractmethod
    def state_rate(self, dynamics: Dynamics, t: float, q: Array, v: Array, u: Array, z: Array) -> Array:
        """Return ż, (state_size,), in the unit of z per second.

        Args:
            dynamics: The rigid bodies of the plant; see `Effect`.
            t: Time, in [s].
            q: Position, (n,), in [rad] or [m].
            v: Velocity, (n,), in [rad/s] or [m/s].
            u: Actuation, (n,), in [N m] or [N]; for a bound, after the preceding bounds.
            z: States of the effect, (state_size,).
        """

    def stored_energy(self, dynamics: Dynamics, t: float, q: Array, z: Array) -> Array:
        """Return the energy E stored in the states, in [J], for the ledger; 0 by default."""
        return 0 * q[..., 0]


class Drive(Stateful, Force, ABC):
    """A stateful force whose motors receive the actuation of some joints, instead of the joints themselves.

    The ledger counts the work of its torque on the joints minus the work of the actuation on its motors.
    """

    @abstractmethod
    def driven(self, n: int) -> Sequence[int]:
        """Return the indices of the joints whose actuation the motors receive, on an arm with n joints."""

    coupled: ClassVar[bool] = False
    """True if motors may move with their joints; `state_rate` then also takes the acceleration a, (n,)."""

    @abstractmethod
    def speeds(self, z: Array) -> Array:
        """Return the velocities at which the actuation of the driven joints does work, in the order of `driven`."""

    def direct_actuation(self, u: Array) -> Array:
        """Return the part of the actuation u, (..., n), that acts on the driven joints; 0 by default."""
        return 0 * u[..., list(self.driven(u.shape[-1]))]

    def added_inertia(self, n: int) -> Array:
        """Return the inertia of motors that move with the driven joints; 0 by default."""
        return np.zeros(len(self.driven(n)))

    def power(self, v: Array, u: Array, torque: Array, z: Array, a: Array) -> Array:
        """Return the power of the torque on the joints minus that of the actuation on the motors, at one state.

        Args:
            v: Velocity, (n,).
            u: Actuation, (n,).
            torque: Torque of the drive on the joints, (n,).
            z: States of the drive.
            a: Acceleration, (n,).
        """
        return torque @ v - u[list(self.driven(len(v)))] @ self.speeds(z)


class Bound(Effect, ABC):
    """An effect that bounds the actuation, applied in the order of the plant's effects.

    To write one, define

        def actuation(self, u): ...                    # the bounded actuation for u, (..., n), in [N m] or [N]
        def thresholds(self, n): ...                   # () if it is smooth everywhere

    A bound that depends on the velocity sets `of_velocity = True` and defines actuation(u, v). Contract: see `Effect`.
    """

    of_velocity: ClassVar[bool] = False
    """True if `actuation` also takes the velocity v, (..., n): the bound then acts between ticks as well."""

    @abstractmethod
    def actuation(self, u: Array) -> Array:
        """Return the bounded actuation for u, (..., n), in [N m] or [N]."""

    def limited(self, u: Array, v: Array) -> Array:
        """Return the values that thresholds of the actuation compare with their levels, (..., n); u by default."""
        return u

    largest: ClassVar[Any] = inf
    """Largest bounded |u|, a scalar or (n,), in [N m] or [N]; inf by default. Runs report it."""


class Timed(Effect):
    """A smooth effect that acts only from time `start_s` until `end_s`, in [s]."""

    start_s: float
    end_s: float

    thresholds = smooth

    def __post_init__(self) -> None:
        super().__post_init__()
        require("end_s must lie after start_s", lambda start, end: start < end, self.start_s, self.end_s)

    @property
    def switches(self) -> tuple[float, ...]:
        return self.start_s, self.end_s

    def acts(self, t: ArrayLike) -> Array:
        """Return True at times t, (...,), at which the effect acts, including `start_s` but not `end_s`."""
        t = rows("t", t)
        return (self.start_s <= t) & (t < self.end_s)


def require(message: str, relation: Callable[..., ArrayLike], *values: object) -> None:
    """Raise an EffectError unless coefficients satisfy a relation for every joint.

    Values by joint name or "urdf", and mismatched numbers of joints, are checked later, when a plant is built.
    """
    if not all(isinstance(x, float | np.ndarray) for x in values):
        return
    try:
        satisfied = np.all(relation(*values))
    except ValueError:  # different numbers of joints
        return
    if not satisfied:
        raise EffectError(f"{message}, got {' and '.join(map(str, values))}")


def check_frame(effect: Effect, dynamics: Dynamics, frame: str) -> None:
    """Raise an EffectError if the arm has no such frame."""
    try:
        dynamics.placement(np.zeros(dynamics.n), frame)
    except QueryError as error:
        raise EffectError(f"{effect.name}: {error}") from None


def numbered(*names: str) -> tuple[str, ...]:
    """Return unique names: repeated ones are numbered, "spring" and "spring 2"."""
    unique: list[str] = []
    for name in names:
        others = (f"{name} {k}" for k in count(2))
        unique.append(name if name not in unique else next(x for x in others if x not in {*unique, *names}))
    return tuple(unique)
