"""LuGre friction: bristles of deflection z between the surfaces, z' = v − σ₀ |v| z / g(v), τ = −(σ₀ z + σ₁ z' + σ₂ v).

    g(v) = f_c + (f_s − f_c) exp(−(v/v_s)²)

At rest the friction is a spring of stiffness σ₀ that holds up to f_s; in steady sliding it is g(v) sign(v) + σ₂ v.
[Canudas de Wit, Olsson, Åström, Lischinsky 1995]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import final

import numpy as np

from robot_dyn.effects.effect import Active, Stateful, require
from robot_dyn.foundations.arithmetic import Array, Scalar
from robot_dyn.foundations.coefficients import CoefficientField, coefficient
from robot_dyn.foundations.threshold import Layer, Threshold
from robot_dyn.queries.dynamics import Dynamics

_SLOW = 1e-6  # relative to v_s: reversals of slower motion have no effect on the result
_REVERSAL = "velocity", "turns positive", "turns negative"


class Bristles(Stateful):
    """Friction with one state for each joint: the deflection z of bristles of stiffness σ, which store ½ σ z²."""

    bristle_stiffness: CoefficientField
    coulomb: CoefficientField

    def state_size(self, n: int) -> int:
        return n

    def stored_energy(self, dynamics: Dynamics, t: float, q: Array, z: Array) -> Array:
        return (self.bristle_stiffness * z**2 / 2).sum(axis=-1)

    def layers(self, n: int) -> tuple[Layer, ...]:
        """Return the deflection f_c/σ over which the bristles of each joint give way."""
        stiffness, sliding = (np.broadcast_to(x, n) for x in (self.bristle_stiffness, self.coulomb))
        joints = np.flatnonzero(stiffness > 0).tolist()
        return tuple(Layer(i, float(sliding[i] / stiffness[i]), level=None, state=i) for i in joints)

    def reversals(self, slack: Scalar, n: int) -> tuple[Threshold, ...]:
        """Return the thresholds at which joints with bristles reverse, for speeds above the slack, (n,)."""
        acts, slow = np.broadcast_to(self.bristle_stiffness, n) > 0, np.broadcast_to(slack, n)
        return tuple(Threshold(i, 0.0, *_REVERSAL, of_velocity=True, slack=slow[i]) for i in range(n) if acts[i])


@final
@dataclass(frozen=True, eq=False)
class LuGreFriction(Bristles, Active):
    """Dry friction with a state for each joint, the deflection z of bristles: τ = −(σ₀ z + σ₁ z' + σ₂ v).

    z' = v − σ₀ |v| z / g(v) and g(v) = f_c + (f_s − f_c) exp(−(v/v_s)²). The bristles store ½ σ₀ z² and return it,
    so that its power may be positive; it is passive where σ₂ ≥ σ₁ (f_s / f_c − 1) [Barahanov, Ortega 2000]. Its rate
    has a kink at v = 0, where steps end, and is stiff: bristles settle within g / (σ₀ |v|) seconds.

    Attributes:
        bristle_stiffness: σ₀, a scalar or (n,), in [N m/rad] or [N/m], not negative.
        bristle_damping: σ₁, in [N m s/rad] or [N s/m], not negative.
        viscous: σ₂, in [N m s/rad] or [N s/m], not negative.
        coulomb: f_c, sliding friction, in [N m] or [N], positive.
        static: f_s, static friction, in [N m] or [N], not less than f_c.
        stribeck_velocity: v_s, in [rad/s] or [m/s], positive.

    Example:
        >>> rd.effects.LuGreFriction(bristle_stiffness=300.0, bristle_damping=1.0, viscous=0.4, coulomb=[0.7, 1.0],
        ...     static=1.2, stribeck_velocity=0.1)
    """

    bristle_stiffness: CoefficientField = field(metadata=coefficient("N m/rad", symbol="σ₀", minimum=0))
    bristle_damping: CoefficientField = field(metadata=coefficient("N m s/rad", symbol="σ₁", minimum=0))
    viscous: CoefficientField = field(metadata=coefficient("N m s/rad", symbol="σ₂", minimum=0))
    coulomb: CoefficientField = field(metadata=coefficient("N m", symbol="f_c", exclusive_minimum=0, fill_value=1.0))
    static: CoefficientField = field(metadata=coefficient("N m", symbol="f_s", exclusive_minimum=0, fill_value=1.0))
    stribeck_velocity: CoefficientField = field(
        metadata=coefficient("rad/s", symbol="v_s", exclusive_minimum=0, fill_value=1.0)
    )

    name = "lugre_friction"
    term = "−(σ₀ z + σ₁ z' + σ₂ v), z' = v − σ₀ |v| z / g(v)"

    def __post_init__(self) -> None:
        super().__post_init__()
        require("static must not be less than coulomb", np.greater_equal, self.static, self.coulomb)

    @property
    def widths(self) -> tuple[Scalar, Scalar]:
        return inf, np.where(np.greater(self.static, self.coulomb), self.stribeck_velocity, inf)

    def layers(self, n: int) -> tuple[Layer, ...]:
        """Return the layers of the deflection, and of the velocity: the change of v by which g changes by about f_c."""
        falls = np.broadcast_to((self.static - self.coulomb) / self.coulomb, n)
        speed, deflections = np.broadcast_to(self.stribeck_velocity, n), super().layers(n)
        joints = [layer.joint for layer in deflections if falls[layer.joint] > 0]
        widths = {i: float(speed[i] / min(falls[i], 1.0)) for i in joints}
        return deflections + tuple(Layer(i, width, of_velocity=True) for i, width in widths.items())

    def thresholds(self, n: int) -> tuple[Threshold, ...]:
        return self.reversals(_SLOW * np.asarray(self.stribeck_velocity), n)

    def state_rate(self, dynamics: Dynamics, t: float, q: Array, v: Array, u: Array, z: Array) -> Array:
        return self._rate(v, z)

    def _rate(self, v: Array, z: Array) -> Array:
        level = self.coulomb + (self.static - self.coulomb) * np.exp(-((v / self.stribeck_velocity) ** 2))
        return v - self.bristle_stiffness * np.abs(v) * z / level

    def torque(  # pyright: ignore[reportIncompatibleMethodOverride]  with its states
        self, dynamics: Dynamics, t: float, q: Array, v: Array, z: Array
    ) -> Array:
        return -(self.bristle_stiffness * z + self.bristle_damping * self._rate(v, z) + self.viscous * v)
