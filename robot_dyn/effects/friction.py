"""Friction in the joints: viscous, τ = −b v, and dry, regularised, τ = −f tanh(v / v_s)."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any, final

import numpy as np

from robot_dyn.arithmetic import Array, tanh
from robot_dyn.effects.effect import Dissipative, coefficient
from robot_dyn.errors import EffectError
from robot_dyn.model.dynamics import Dynamics


@final
@dataclass(frozen=True, eq=False)
class ViscousFriction(Dissipative):
    """Torque proportional to joint velocity and opposed to it: τ = −b v.

    Attributes:
        damping: b, a scalar or (n,), in [N m s/rad] or [N s/m], not negative.
    """

    damping: Any

    coefficients = ("damping",)

    def __post_init__(self) -> None:
        object.__setattr__(self, "damping", coefficient("damping", self.damping, least=0))

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        return -self.damping * v


@final
@dataclass(frozen=True, eq=False)
class RegularisedCoulombFriction(Dissipative):
    """Dry friction made smooth: τ = −f tanh(v / v_s).

    Inside |v| < v_s it creeps and does not stick; its slope f / v_s is stiff where v_s is small.

    Attributes:
        friction: f, a scalar or (n,), in [N m] or [N], not negative.
        velocity_scale: v_s, a scalar or (n,), in [rad/s] or [m/s], positive.
    """

    friction: Any
    velocity_scale: Any = 0.01

    coefficients = "friction", "velocity_scale"

    def __post_init__(self) -> None:
        object.__setattr__(self, "friction", coefficient("friction", self.friction, least=0))
        object.__setattr__(self, "velocity_scale", coefficient("velocity_scale", self.velocity_scale, least=0))
        if isinstance(self.velocity_scale, np.ndarray) and not (self.velocity_scale > 0).all():
            raise EffectError(f"velocity_scale must be positive, got {self.velocity_scale}")

    @property
    def widths(self) -> tuple[Any, Any]:
        return inf, self.velocity_scale

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        return -self.friction * tanh(v / self.velocity_scale)
