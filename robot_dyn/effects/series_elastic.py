"""Series-elastic joints: a geared motor moves its joint through a spring and a damper, δ = θ − q.

    n² J θ̈ = u − k δ − d δ̇ − b θ̇,     τ = k δ + d δ̇

θ is the motor angle at the output of the gear, u the torque there, n times the torque of the motor. Rotation of the
rotor with the arm is neglected. [Spong 1987; Albu-Schäffer, Ott, Hirzinger 2007]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import final

import numpy as np

from robot_dyn.effects.effect import Dissipative
from robot_dyn.effects.geared_motor import GearedMotor
from robot_dyn.foundations.arithmetic import Array, positive_part
from robot_dyn.foundations.coefficients import (
    CoefficientField,
    OptionalCoefficientField,
    coefficient,
    default,
    with_values,
)
from robot_dyn.foundations.threshold import Threshold
from robot_dyn.queries.dynamics import Dynamics

_FORWARD = ("forward side of the backlash", "touched", "left")
_BACKWARD = ("backward side of the backlash", "left", "touched")


@final
@dataclass(frozen=True, eq=False)
class SeriesElastic(GearedMotor, Dissipative):
    """Joints that a motor drives through a gear, a spring and a damper: τ = k δ + d δ̇, n² J θ̈ = u − τ − b θ̇.

    δ = θ − q is the deflection of the spring, θ the motor angle at the output of the gear. The states are δ of all
    driven joints, then θ̇. A run starts with relaxed springs, δ = 0, and motors that move with their joints. The
    actuation u of a driven joint is the motor torque at the output of the gear, n times the torque of the rotor. With
    a half gap β the spring exerts no torque while |δ| ≤ β; the damper still acts.

    In the energy ledger, control works on the motors; motors and springs store ½ n² J θ̇² + ½ k δ². Rotation of the
    rotors with the arm is neglected.

    Attributes:
        stiffness: k, a scalar or (n,), in [N m/rad] or [N/m], not negative; joints of stiffness 0 are driven directly.
        inertia: J of the rotor, in [kg m²], or [kg] for a prismatic joint, positive.
        ratio: n of the gear; 1 by default.
        damping: d of the spring, in [N m s/rad] or [N s/m], not negative; 0 by default.
        viscous: b of the motor at the output of the gear, in [N m s/rad] or [N s/m], not negative; 0 by default.
        half_gap: β, half of the play of the gear, in [rad] or [m], not negative; 0 by default. A data sheet usually
            states the play, 2β.

    Example:
        >>> rd.effects.SeriesElastic(stiffness=[0.0, 80.0], inertia=0.02, ratio=5.0, damping=0.1, viscous=0.2,
        ...     half_gap=0.01)
    """

    stiffness: CoefficientField = field(metadata=coefficient("N m/rad", symbol="k", minimum=0))
    inertia: CoefficientField = field(metadata=coefficient("kg m²", symbol="J", exclusive_minimum=0, fill_value=1.0))
    ratio: OptionalCoefficientField = field(
        default=default(None), metadata=coefficient(symbol="n", exclusive_minimum=0, fill_value=1.0)
    )
    damping: OptionalCoefficientField = field(
        default=default(None), metadata=coefficient("N m s/rad", symbol="d", minimum=0)
    )
    viscous: OptionalCoefficientField = field(
        default=default(None), metadata=coefficient("N m s/rad", symbol="b", minimum=0)
    )
    half_gap: OptionalCoefficientField = field(
        default=default(None), metadata=coefficient("rad", symbol="β", minimum=0)
    )

    joints: tuple[int, ...] | None = field(default=None, init=False, repr=False)
    _side: OptionalCoefficientField = field(
        default=default(None), init=False, repr=False, metadata=coefficient(can_vary=False)
    )

    through = "stiffness"
    term = "k δ + d δ̇, n² J θ̈ = u − k δ − d δ̇ − b θ̇, δ = θ − q"

    def thresholds(self, n: int) -> tuple[Threshold, ...]:
        if self.half_gap is None:
            return ()
        gaps = self.per_joint("half_gap", n)
        return tuple(
            Threshold(i, way * float(gaps[k]), *words, state=k)
            for way, words in ((1, _FORWARD), (-1, _BACKWARD))
            for k, i in enumerate(self._driven)
            if gaps[k] > 0
        )

    def on_side(self, n: int, sides: Mapping[Threshold, int]) -> SeriesElastic:
        if self.half_gap is None:
            return self
        side = np.zeros(n)
        for threshold, passed in sides.items():
            way = 1 if threshold.name == _FORWARD[0] else -1
            side[threshold.joint] += way * (passed == way)
        return with_values(self, {"_side": side})

    def speeds(self, z: Array) -> Array:
        return z[len(self._driven) :]

    def state_size(self, n: int) -> int:
        return 2 * len(self._driven)

    def start(self, dynamics: Dynamics, q: Array, v: Array) -> Array:
        v = v[..., self._driven]
        return np.concatenate([0 * v, v], axis=-1)

    def state_rate(self, dynamics: Dynamics, t: float, q: Array, v: Array, u: Array, z: Array) -> Array:
        n, speed = dynamics.n, self.speeds(z)
        load = self._torque(n, v, z)
        if self.viscous is not None:
            load = load + self.per_joint("viscous", n) * speed
        return np.concatenate([speed - v[self._driven], (u[self._driven] - load) / self.reflected(n)])

    def torque(  # pyright: ignore[reportIncompatibleMethodOverride]  with its states
        self, dynamics: Dynamics, t: float, q: Array, v: Array, z: Array
    ) -> Array:
        torque = 0 * v
        torque[..., self._driven] = self._torque(dynamics.n, v, z)
        return torque

    def stored_energy(self, dynamics: Dynamics, t: float, q: Array, z: Array) -> Array:
        n, k = dynamics.n, self.per_joint("stiffness", dynamics.n)
        return (self.reflected(n) * self.speeds(z) ** 2 / 2 + k * self._stretch(n, z) ** 2 / 2).sum(axis=-1)

    def _stretch(self, n: int, z: Array) -> Array:
        """Return the deflection of the springs, minus the half gap."""
        deflection = z[..., : len(self._driven)]
        if self.half_gap is None:
            return deflection
        gap = self.per_joint("half_gap", n)
        if self._side is None:
            return positive_part(deflection - gap) - positive_part(-gap - deflection)
        side = self.per_joint("_side", n)
        return side**2 * deflection - side * gap

    def _torque(self, n: int, v: Array, z: Array) -> Array:
        torque = self.per_joint("stiffness", n) * self._stretch(n, z)
        if self.damping is None:
            return torque
        return torque + self.per_joint("damping", n) * (z[..., len(self._driven) :] - v[..., self._driven])
