"""The equation of motion, M(q) a + C(q, v) v + N(t, q, v) = Υ, with N = ∂V/∂q − Σ τ_effect.

    a = M⁻¹ (Υ + Σ τ_effect − C v − ∂V/∂q),    ṗ = Υ + Σ τ_effect + Cᵀ v − ∂V/∂q  with p = M v

Its arguments are not checked: floats, balls or symbols. [Murray, Li, Sastry 1994, eq. 4.24]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.effects.effect import Bound, Conservative, Effect, Force
from robot_dyn.errors import EffectError
from robot_dyn.foreign import call, users_line
from robot_dyn.model.dynamics import Dynamics


@final
@dataclass(frozen=True)
class EquationOfMotion:
    """The terms of the equation, for one state (n,) or states (..., n).

    Attributes:
        dynamics: The rigid bodies in gravity.
        effects: What else acts.
    """

    dynamics: Dynamics
    effects: tuple[Effect, ...]

    @cached_property
    def forces(self) -> tuple[Force, ...]:
        """The effects that are torques."""
        return tuple(effect for effect in self.effects if isinstance(effect, Force))

    def torques(self, t: float, q: Array, v: Array, shape: tuple[int, ...] | None = None) -> list[Array]:
        """The torque of each force, of the shape if one is given; EffectError if one does not fit the joints."""
        return [self._torque_of(force, t, q, v, shape) for force in self.forces]

    def _torque_of(self, force: Force, t: float, q: Array, v: Array, shape: tuple[int, ...] | None) -> Array:
        try:
            torque = call(force.torque, self.dynamics, t, q, v)
            return torque if shape is None or np.shape(torque) == shape else np.broadcast_to(torque, shape)
        except (TypeError, ValueError) as error:
            if users_line(error):
                raise
            raise EffectError(
                f"{force.name} does not fit {self.dynamics.n} joints and v of shape {v.shape}: {error}"
            ) from None

    def actuation(self, u: Array) -> Array:
        """What the bounds leave of the actuation u, in the order of the effects; EffectError if one does not fit."""
        shape = np.shape(u)
        for effect in self.effects:
            if isinstance(effect, Bound):
                try:
                    u = call(effect.actuation, u)
                except (TypeError, ValueError) as error:
                    if users_line(error):
                        raise
                    raise EffectError(f"{effect.name} does not fit an actuation of shape {shape}: {error}") from None
        return u

    def N(self, q: Array, torque: Array) -> Array:
        """Every force but actuation, with the torque Σ τ_effect."""
        return self.dynamics.N(q) - torque

    def inverse_dynamics(self, q: Array, v: Array, a: Array, torque: Array) -> Array:
        """The actuation that gives the acceleration a."""
        return self.dynamics.inverse_dynamics(q, v, a) - torque

    def acceleration(self, q: Array, v: Array, total: Array) -> Array:
        """The acceleration under the total torque Υ + Σ τ_effect."""
        return self.dynamics.forward_dynamics(q, v, total)

    def momentum_rate(self, q: Array, v: Array, total: Array) -> Array:
        """The rate of the momentum p = M v under the total torque."""
        return total + self.dynamics.coriolis_transpose(q, v) - self.dynamics.N(q)

    def energies(self, t: Array, q: Array, v: Array) -> tuple[Array, Array]:
        """Kinetic energy, and the potential of gravity and of all conservative effects, (...)."""
        potential = self.dynamics.potential_energy(q)
        for force in self.forces:
            if isinstance(force, Conservative):
                potential = potential + call(force.potential, self.dynamics, t, q)
        return self.dynamics.kinetic_energy(q, v), potential

    def powers(self, v: Array, u: Array, torques: list[Array]) -> list[Array]:
        """Power of the actuation, and of each force without a potential, at one state."""
        each = zip(self.forces, torques, strict=True)
        return [u @ v, *(torque @ v for force, torque in each if not isinstance(force, Conservative))]
