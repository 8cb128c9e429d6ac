"""Spring in a joint: τ = −k (q − q₀), of energy ½ k (q − q₀)²."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, final

from robot_dyn.effects.effect import Conservative
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.coefficients import coefficient
from robot_dyn.foundations.threshold import smooth
from robot_dyn.queries.dynamics import Dynamics


@final
@dataclass(frozen=True, eq=False)
class Spring(Conservative):
    """Torque proportional to the distance from a rest position: τ = −k (q − q₀).

    Attributes:
        stiffness: k, a scalar or (n,), in [N m/rad] or [N/m], not negative.
        rest: q₀, a scalar or (n,), in [rad] or [m].

    Example:
        >>> rd.effects.Spring(stiffness=2.0, rest=[0.1, -0.2])
    """

    stiffness: Any = field(metadata=coefficient("N m/rad", symbol="k", least=0))
    rest: Any = field(default=0.0, metadata=coefficient("rad", symbol="q₀"))

    term = "−k (q − q₀)"
    thresholds = smooth

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        return -self.stiffness * (q - self.rest)

    def potential(self, dynamics: Dynamics, t: float, q: Array) -> Array:
        return (self.stiffness * (q - self.rest) ** 2 / 2).sum(axis=-1)
