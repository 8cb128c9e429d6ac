"""Plant: rigid bodies and what acts on them, M(q) a + C(q, v) v + N(t, q, v) = Υ, with N = ∂V/∂q − Σ τ_effect.

[Murray, Li, Sastry 1994, eq. 4.24]
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import Any, final

import numpy as np

from robot_dyn.arithmetic import FLOAT64, Arithmetic, Array
from robot_dyn.effects.effect import Bound, Effect, Force
from robot_dyn.effects.friction import RegularisedCoulombFriction, ViscousFriction
from robot_dyn.errors import EffectError, OverflowedError, shown
from robot_dyn.foreign import call, users_line
from robot_dyn.model.dynamics import Dynamics
from robot_dyn.validate import check_batches, is_moderate, is_state, joint_values, number


@final
@dataclass(frozen=True)
class Plant:
    """A `Dynamics` and the effects that act on it.

    Attributes:
        dynamics: The rigid bodies in gravity.
        effects: What else acts; "urdf" for the friction that the robot's file states, each kind only if it states any.
    """

    dynamics: Dynamics
    effects: tuple[Effect, ...] = ()

    def __init__(self, dynamics: Dynamics, effects: Iterable[Effect] | str = ()) -> None:
        if isinstance(dynamics, type) or not isinstance(dynamics, Dynamics):
            raise EffectError(f"dynamics: give a robot, such as rd.load('ur5'), got {shown(dynamics)}")
        object.__setattr__(self, "dynamics", dynamics)
        if isinstance(effects, str):
            if effects != "urdf":
                raise EffectError(f"effects={shown(effects)}; give effects, or 'urdf' for those the file states")
            effects = stated_friction(dynamics)
        if not isinstance(effects, Iterable):
            raise EffectError(f"effects must be several, such as [rd.ViscousFriction(0.1)], got {shown(effects)}")
        effects = tuple(effects)
        for effect in effects:
            if not isinstance(effect, Force | Bound):
                raise EffectError(
                    f"{shown(effect)} is neither a Force nor a Bound, so nothing would evaluate it; subclass"
                    " Conservative, Dissipative, Active or Bound"
                )
        object.__setattr__(self, "effects", tuple(effect.on(dynamics) for effect in effects))

    @cached_property
    def forces(self) -> tuple[Force, ...]:
        """The effects that are torques."""
        return tuple(effect for effect in self.effects if isinstance(effect, Force))

    def actuation(self, u: Array) -> Array:
        """What the bounds among the effects leave of the actuation u, (..., n); EffectError if one does not fit."""
        (u,) = (u,) if self._is_plain(u) else self._states(u=u)
        return bounded(self.effects, u)

    def M(self, q: Array) -> Array:
        """Mass matrix, (..., n, n)."""
        return self.dynamics.M(q)

    def C(self, q: Array, v: Array) -> Array:
        """Coriolis matrix, (..., n, n)."""
        return self.dynamics.C(q, v)

    def N(self, t: float, q: Array, v: Array) -> Array:
        """Every force but actuation, as what must be overcome: N = ∂V/∂q − Σ τ_effect, (..., n)."""
        torque = self.torque(t, q, v)
        return self._finite(self.dynamics.N(q) - torque)

    def torque(self, t: float, q: Array, v: Array) -> Array:
        """Σ τ_effect, the torque of all effects on the joints, (..., n); 0 without effects.

        Args:
            t: Time, one number, in [s].
            q: Position, (..., n).
            v: Velocity, (..., n).

        Raises:
            QueryError: If an argument has another shape or is not finite; OverflowedError if the result is not.
            EffectError: If an effect does not fit the joints.
        """
        if t.__class__ is float and isfinite(t) and self._is_plain(q) and self._is_plain(v):
            total = self._sum(t, q, v, np.zeros(self.dynamics.n))
            if is_moderate(total):
                return total
        t, (q, v) = number("t", t), self._states(q=q, v=v)
        zeros = np.zeros((*check_batches(q=q, v=v), self.dynamics.n))
        with self._arithmetic.scope(), np.errstate(all="ignore"):  # what overflows is told in words
            zeros = zeros if q.dtype != object else self._arithmetic.array(zeros)
            return self._finite(self._sum(t, q, v, zeros))

    def _sum(self, t: float, q: Array, v: Array, zeros: Array) -> Array:
        """Σ τ_effect of arguments that were checked."""
        total = zeros
        for force in self.forces:
            total = total + torque_of(force, self.dynamics, t, q, v, zeros.shape)
        return total

    def inverse_dynamics(self, t: float, q: Array, v: Array, a: Array) -> Array:
        """Actuation Υ = M a + C v + N that gives the acceleration a, (..., n)."""
        torque = self.torque(t, q, v)
        return self._finite(self.dynamics.inverse_dynamics(q, v, a) - torque)

    def forward_dynamics(self, t: float, q: Array, v: Array, u: Array) -> Array:
        """Acceleration under the actuation u, (..., n)."""
        return self.dynamics.forward_dynamics(q, v, self.actuation(u) + self.torque(t, q, v))

    @cached_property
    def _arithmetic(self) -> Arithmetic:
        return getattr(self.dynamics, "arithmetic", FLOAT64)

    @cached_property
    def _shape(self) -> tuple[int] | None:
        """Shape of one state, of which the checks are short; None if it has to be made of other numbers."""
        return (self.dynamics.n,) if self._arithmetic == FLOAT64 else None

    def _is_plain(self, x: Any) -> bool:
        return is_state(x, self._shape) and is_moderate(x)

    def _states(self, **given: Any) -> list[Array]:
        names = self.dynamics.joint_names
        return [joint_values(name, x, names, self._arithmetic) for name, x in given.items()]

    def _finite(self, result: Array) -> Array:
        if not self._arithmetic.finite(result).all():
            raise OverflowedError("the arguments are so large that the result overflows")
        return result


def bounded(effects: Iterable[Effect], u: Array) -> Array:
    """What the bounds among effects leave of an actuation, (..., n), that is not checked: floats, balls or symbols.

    Raises:
        EffectError: If a bound does not fit it.
    """
    shape = np.shape(u)
    for effect in effects:
        if isinstance(effect, Bound):
            try:
                u = call(effect.actuation, u)
            except (TypeError, ValueError) as error:
                if users_line(error):
                    raise
                raise EffectError(f"{effect.name} does not fit an actuation of shape {shape}: {error}") from None
    return u


def torque_of(
    force: Force, dynamics: Dynamics, t: float, q: Array, v: Array, shape: tuple[int, ...] | None = None
) -> Array:
    """The torque of one effect, of the shape if one is given; EffectError if it does not fit the joints."""
    try:
        torque = call(force.torque, dynamics, t, q, v)
        return torque if shape is None or np.shape(torque) == shape else np.broadcast_to(torque, shape)
    except (TypeError, ValueError) as error:
        if users_line(error):
            raise
        raise EffectError(f"{force.name} does not fit {dynamics.n} joints and v of shape {v.shape}: {error}") from None


def stated_friction(dynamics: Any) -> tuple[Effect, ...]:
    """The friction that the file of a robot states.

    Raises:
        EffectError: If the dynamics comes from no file.
    """
    try:
        damping, friction = dynamics.damping, dynamics.friction
    except AttributeError:
        raise EffectError(f"effects='urdf' needs a robot with a URDF, got {type(dynamics).__name__}") from None
    effects: list[Effect] = []
    if np.any(damping):
        effects.append(ViscousFriction(damping))
    if np.any(friction):
        effects.append(RegularisedCoulombFriction(friction))
    return tuple(effects)
