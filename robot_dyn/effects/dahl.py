"""Dahl friction: bristles whose force F = σ z follows a curve of the path, dF/dq = σ |1 − F s/f_c|^α sign(1 − F s/f_c).

    s = sign(v),   τ = −σ z

From rest the friction is a spring of stiffness σ. While the joint slides, |F| approaches f_c; after a reversal F
follows the other branch of the hysteresis. F depends on the path, not on time. [Dahl 1968; Dahl 1976; Bliman 1992]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from robot_dyn.effects.effect import Dissipative
from robot_dyn.effects.lugre import Bristles
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.coefficients import CoefficientField, OptionalCoefficientField, coefficient, default
from robot_dyn.foundations.threshold import Threshold
from robot_dyn.queries.dynamics import Dynamics

_SLOW = 1e-6  # relative to the deflection f_c/σ, per second: reversals of slower motion have no effect on the result


@final
@dataclass(frozen=True, eq=False)
class DahlFriction(Bristles, Dissipative):
    """Dry friction with a state for each joint, the deflection z of bristles: τ = −σ z.

    z' = |w|^α sign(w) v with w = 1 − (σ z/f_c) sign(v). The bristles store ½ σ z² and return part of it: the
    effect is passive. Static and sliding friction both equal f_c, which is approached over a path of about f_c/σ. The
    rate has a kink at v = 0, where steps end.

    Attributes:
        bristle_stiffness: σ, a scalar or (n,), in [N m/rad] or [N/m], not negative.
        coulomb: f_c, in [N m] or [N], positive.
        exponent: α, not less than 1; 1 by default.

    Example:
        >>> rd.effects.DahlFriction(bristle_stiffness=300.0, coulomb=[0.7, 1.0], exponent=1.5)
    """

    bristle_stiffness: CoefficientField = field(metadata=coefficient("N m/rad", symbol="σ", minimum=0))
    coulomb: CoefficientField = field(metadata=coefficient("N m", symbol="f_c", exclusive_minimum=0, fill_value=1.0))
    exponent: OptionalCoefficientField = field(
        default=default(None), metadata=coefficient(symbol="α", minimum=1, fill_value=1.0)
    )

    term = "−σ z, z' = |w|^α sign(w) v, w = 1 − (σ z/f_c) sign(v)"

    def thresholds(self, n: int) -> tuple[Threshold, ...]:
        stiffness = np.broadcast_to(self.bristle_stiffness, n)
        slow = np.divide(_SLOW * self.coulomb, stiffness, out=np.zeros(n), where=stiffness > 0)
        return self.reversals(slow, n)

    def state_rate(self, dynamics: Dynamics, t: float, q: Array, v: Array, u: Array, z: Array) -> Array:
        relative = self.bristle_stiffness * z / self.coulomb
        if self.exponent is None:
            return v - relative * np.abs(v)
        w = 1 - relative * np.sign(v)
        return np.abs(w) ** self.exponent * np.sign(w) * v

    def torque(  # pyright: ignore[reportIncompatibleMethodOverride]  with its states
        self, dynamics: Dynamics, t: float, q: Array, v: Array, z: Array
    ) -> Array:
        return -self.bristle_stiffness * z
