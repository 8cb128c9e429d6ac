"""Spring in a joint: τ = −k (q − q₀), of energy ½ k (q − q₀)²."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from robot_dyn.effects.effect import Conservative, Effect
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.coefficients import URDF, CoefficientField, coefficient, default
from robot_dyn.foundations.errors import EffectError
from robot_dyn.foundations.threshold import smooth
from robot_dyn.queries.dynamics import Dynamics


@final
@dataclass(frozen=True, eq=False)
class Spring(Conservative):
    """Torque proportional to the distance from a rest position: τ = −k (q − q₀).

    Attributes:
        stiffness: k, a scalar or (n,), in [N m/rad] or [N/m], not negative.
        rest: q₀, a scalar or (n,), in [rad] or [m]. If stiffness="urdf" and the file states rest positions, it must be
            "urdf" or an array.

    Example:
        >>> rd.effects.Spring(stiffness=2.0, rest=[0.1, -0.2])
    """

    stiffness: CoefficientField = field(
        metadata=coefficient("N m/rad", symbol="k", minimum=0, stated="stated_stiffness")
    )
    rest: CoefficientField = field(default=default(0.0), metadata=coefficient("rad", symbol="q₀", stated="stated_rest"))

    term = "−k (q − q₀)"
    thresholds = smooth

    def on(self, dynamics: Dynamics) -> Effect:
        rest = getattr(dynamics, "stated_rest", np.zeros(1))
        if self.stiffness is URDF and np.shape(self.rest) == () and self.rest is not URDF and rest.any():
            raise EffectError(
                f"{self.name}: the file states rest positions of these springs; give rest='urdf', or an array"
            )
        return super().on(dynamics)

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        return -self.stiffness * (q - self.rest)

    def potential(self, dynamics: Dynamics, t: float, q: Array) -> Array:
        return (self.stiffness * (q - self.rest) ** 2 / 2).sum(axis=-1)
