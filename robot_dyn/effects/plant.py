"""Plant: rigid bodies and what acts on them, M(q) a + C(q, v) v + N(t, q, v) = Υ, with N = ∂V/∂q − Σ τ_effect.

[Murray, Li, Sastry 1994, eq. 4.24]
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.effects.effect import Bound, Effect, Force
from robot_dyn.effects.friction import RegularisedCoulombFriction, ViscousFriction
from robot_dyn.errors import EffectError, QueryError
from robot_dyn.model.dynamics import Dynamics


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
        object.__setattr__(self, "dynamics", dynamics)
        if isinstance(effects, str):
            if effects != "urdf":
                raise EffectError(f"effects={effects!r}; give effects, or 'urdf' for those the file states")
            effects = stated_friction(dynamics)
        try:
            effects = tuple(effects)
        except TypeError:
            raise EffectError(f"effects must be several, such as [rd.ViscousFriction(0.1)], got {effects!r}") from None
        for effect in effects:
            if not isinstance(effect, Force | Bound):
                raise EffectError(
                    f"{effect!r} is neither a Force nor a Bound, so nothing would evaluate it; subclass Conservative,"
                    " Dissipative, Active or Bound"
                )
        object.__setattr__(self, "effects", tuple(effect.on(dynamics) for effect in effects))

    @cached_property
    def forces(self) -> tuple[Force, ...]:
        """The effects that are torques."""
        return tuple(effect for effect in self.effects if isinstance(effect, Force))

    def actuation(self, u: Array) -> Array:
        """What the bounds among the effects leave of the actuation u, (..., n); EffectError if one does not fit."""
        shape = np.shape(u)
        for effect in self.effects:
            if isinstance(effect, Bound):
                try:
                    u = effect.actuation(u)
                except (TypeError, ValueError) as error:
                    raise EffectError(f"{effect.name} does not fit an actuation of shape {shape}: {error}") from None
        return u

    def M(self, q: Array) -> Array:
        """Mass matrix, (..., n, n)."""
        return self.dynamics.M(q)

    def C(self, q: Array, v: Array) -> Array:
        """Coriolis matrix, (..., n, n)."""
        return self.dynamics.C(q, v)

    def N(self, t: float, q: Array, v: Array) -> Array:
        """Every force but actuation, as what must be overcome: N = ∂V/∂q − Σ τ_effect, (..., n)."""
        return self.dynamics.N(q) - self.torque(t, q, v)

    def torque(self, t: float, q: Array, v: Array) -> Array:
        """Σ τ_effect, the torque of all effects on the joints, (..., n); 0 without effects.

        Raises:
            QueryError: If v has the wrong shape.
            EffectError: If an effect does not fit the joints.
        """
        n, q, v = self.dynamics.n, np.asarray(q), np.asarray(v)
        if v.shape[-1:] != (n,):
            raise QueryError(f"v must have shape ({n},) or (..., {n}), got {v.shape}")
        try:
            return sum(force.torque(self.dynamics, t, q, v) for force in self.forces)
        except (TypeError, ValueError) as error:
            raise EffectError(f"an effect does not fit {n} joints and v of shape {v.shape}: {error}") from None

    def inverse_dynamics(self, t: float, q: Array, v: Array, a: Array) -> Array:
        """Actuation Υ = M a + C v + N that gives the acceleration a, (..., n)."""
        return self.dynamics.inverse_dynamics(q, v, a) - self.torque(t, q, v)

    def forward_dynamics(self, t: float, q: Array, v: Array, u: Array) -> Array:
        """Acceleration under the actuation u, (..., n)."""
        u = np.asarray(u)
        if u.dtype.kind not in "fiuO":
            raise QueryError(f"u must be an array of {self.dynamics.n} numbers, got {u!r}")
        return self.dynamics.forward_dynamics(q, v, self.actuation(u) + self.torque(t, q, v))


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
