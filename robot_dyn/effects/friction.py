"""Friction in the joints: viscous, τ = −b v, and dry, regularised, τ = −f tanh(v / v_s)."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import final

import numpy as np

from robot_dyn.effects.effect import Dissipative
from robot_dyn.foundations.arithmetic import Array, Scalar, tanh
from robot_dyn.foundations.coefficients import CoefficientField, coefficient, default
from robot_dyn.foundations.threshold import smooth
from robot_dyn.queries.dynamics import Dynamics


@final
@dataclass(frozen=True, eq=False)
class ViscousFriction(Dissipative):
    """Torque proportional to joint velocity and opposed to it: τ = −b v.

    Attributes:
        viscous: b, a scalar or (n,), in [N m s/rad] or [N s/m], not negative.

    Example:
        >>> rd.effects.ViscousFriction(viscous=[0.3, 0.1])
    """

    viscous: CoefficientField = field(metadata=coefficient("N m s/rad", symbol="b", minimum=0, stated="damping"))

    term = "−b v"
    thresholds = smooth

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        return -self.viscous * v


@final
@dataclass(frozen=True, eq=False)
class RegularisedCoulombFriction(Dissipative):
    """Regularised dry friction: τ = −f tanh(v / v_s).

    Inside |v| < v_s it creeps and does not stick; its slope f / v_s is stiff where v_s is small.

    Attributes:
        coulomb: f, a scalar or (n,), in [N m] or [N], not negative.
        velocity_scale: v_s, a scalar or (n,), in [rad/s] or [m/s], positive.

    Example:
        >>> rd.effects.RegularisedCoulombFriction(coulomb=0.2, velocity_scale=[0.05, 0.1])
    """

    coulomb: CoefficientField = field(metadata=coefficient("N m", symbol="f", minimum=0, stated="friction"))
    velocity_scale: CoefficientField = field(
        default=default(0.01), metadata=coefficient("rad/s", symbol="v_s", exclusive_minimum=0)
    )

    term = "−f tanh(v / v_s)"
    thresholds = smooth

    @property
    def widths(self) -> tuple[Scalar, Scalar]:
        return inf, np.where(np.asarray(self.coulomb) > 0, self.velocity_scale, inf)

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        return -self.coulomb * tanh(v / self.velocity_scale)
