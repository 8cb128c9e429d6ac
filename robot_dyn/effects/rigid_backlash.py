"""Rigid backlash: a motor moves freely within a gap of its gear, and strikes and pushes its joint at both ends.

    |δ| ≤ β,  δ = θ − q:   n² J θ̈ = u − b θ̇ within the gap;   δ̇⁺ = −e δ̇⁻ where an end is struck;   θ̈ = q̈ where it rests

θ is the motor angle at the output of the gear. One convex problem solves an impact for the whole arm and its motors.
[Nordin, Gutman 2002; Brogliato, Nonsmooth Mechanics, 2016]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, final

import numpy as np

from robot_dyn.effects.effect import require
from robot_dyn.effects.geared_motor import GearedMotor
from robot_dyn.effects.set_valued import Interval, Mode, SetValued
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.coefficients import (
    CoefficientField,
    OptionalCoefficientField,
    coefficient,
    default,
    with_values,
)
from robot_dyn.queries.dynamics import Dynamics


@final
@dataclass(frozen=True, eq=False)
class RigidBacklash(GearedMotor, SetValued):
    """Joints that a motor drives through a rigid gear with a gap: |δ| ≤ β, δ = θ − q, and δ̇⁺ = −e δ̇⁻ at its ends.

    A run starts in the middle of the gap, δ = 0, with motors that move with their joints. The actuation u of such a
    joint is the motor torque at the output of the gear, n times the torque of the rotor. Steps end when an end of the
    gap is reached or left. The states are δ of all driven joints, then δ̇, θ̇, and the contact impulse of the last step.

    In the energy ledger, control works on the motors, which store ½ n² J θ̇². Rotation of the rotors with the arm is
    neglected.

    Attributes:
        half_gap: β, half of the play, a scalar or (n,), in [rad] or [m], not negative; a data sheet usually states the
            play, 2β. Joints of half gap 0 are driven directly.
        inertia: J of the rotor, in [kg m²], or [kg] for a prismatic joint, positive.
        ratio: n of the gear; 1 by default.
        restitution: e, a scalar or (n,), 0 to 1; 0 by default.
        viscous: b of the motor at the output of the gear, in [N m s/rad] or [N s/m], not negative; 0 by default.

    Example:
        >>> rd.effects.RigidBacklash(half_gap=[0.01, 0.0], inertia=0.02, ratio=5.0, restitution=0.4, viscous=0.2)
    """

    half_gap: CoefficientField = field(metadata=coefficient("rad", symbol="β", minimum=0))
    inertia: CoefficientField = field(metadata=coefficient("kg m²", symbol="J", exclusive_minimum=0, fill_value=1.0))
    ratio: OptionalCoefficientField = field(
        default=default(None), metadata=coefficient(symbol="n", exclusive_minimum=0, fill_value=1.0)
    )
    restitution: CoefficientField = field(default=default(0.0), metadata=coefficient(symbol="e", minimum=0))
    viscous: OptionalCoefficientField = field(
        default=default(None), metadata=coefficient("N m s/rad", symbol="b", minimum=0)
    )

    joints: tuple[int, ...] | None = field(default=None, init=False, repr=False)
    held: OptionalCoefficientField = field(
        default=default(None), init=False, repr=False, metadata=coefficient(can_vary=False)
    )
    _contact: OptionalCoefficientField = field(
        default=default(None), init=False, repr=False, metadata=coefficient(can_vary=False)
    )

    coupled: ClassVar[bool] = True
    through = "half_gap"
    term = "|δ| ≤ β, δ = θ − q, δ̇⁺ = −e δ̇⁻, n² J θ̈ = u − b θ̇ within"

    def __post_init__(self) -> None:
        super().__post_init__()
        require("restitution must not be greater than 1", lambda e: e <= 1, self.restitution)

    def speeds(self, z: Array) -> Array:
        k = len(self._driven)
        return z[2 * k : 3 * k]

    def in_mode(self, mode: Mode) -> RigidBacklash:
        contact = np.zeros_like(mode.held) if mode.contact is None else mode.contact
        return with_values(self, {"held": mode.held, "_contact": contact})

    def at_rest(self, q: np.ndarray) -> Interval:
        return Interval(np.zeros_like(q), np.zeros_like(q))

    def state_size(self, n: int) -> int:
        return 4 * len(self._driven)

    def start(self, dynamics: Dynamics, q: Array, v: Array) -> Array:
        v = v[..., self._driven]
        return np.concatenate([0 * v, 0 * v, v, 0 * v], axis=-1)

    def drag(self, n: int, z: Array) -> Array:
        """Return the friction b θ̇ of the motors, (k,)."""
        return 0 * self.speeds(z) if self.viscous is None else self.per_joint("viscous", n) * self.speeds(z)

    def _touching(self, n: int) -> Array:
        """Return 1 for driven joints whose motor rests at an end of the gap, else 0, (k,)."""
        return np.zeros(len(self._driven)) if self._contact is None else self.per_joint("_contact", n) ** 2

    def direct_actuation(self, u: Array) -> Array:
        return self._touching(u.shape[-1]) * u[..., self._driven]

    def added_inertia(self, n: int) -> Array:
        return self._touching(n) * self.reflected(n)

    def state_rate(  # pyright: ignore[reportIncompatibleMethodOverride]  with the acceleration
        self, dynamics: Dynamics, t: float, q: Array, v: Array, u: Array, z: Array, a: Array
    ) -> Array:
        n, k, touching = dynamics.n, len(self._driven), self._touching(dynamics.n)
        inertia, a = self.reflected(n), a[self._driven]
        torque = u[self._driven] - self.drag(n, z)
        free = (1 - touching) * (torque / inertia)
        relative = free - (1 - touching) * a
        return np.concatenate([z[k : 2 * k], relative, free + touching * a, touching * (inertia * a - torque)])

    def torque(  # pyright: ignore[reportIncompatibleMethodOverride]  with its states
        self, dynamics: Dynamics, t: float, q: Array, v: Array, z: Array
    ) -> Array:
        torque = 0 * v
        if self.viscous is not None and self._contact is not None:
            torque[self._driven] = -self._touching(dynamics.n) * self.drag(dynamics.n, z)
        return torque

    def power(self, v: Array, u: Array, torque: Array, z: Array, a: Array) -> Array:
        n, d = len(v), self._driven
        pushed = self._touching(n) * (u[d] - self.reflected(n) * a[d])
        return torque @ v + pushed @ v[d] - u[d] @ self.speeds(z)

    def stored_energy(self, dynamics: Dynamics, t: float, q: Array, z: Array) -> Array:
        return (self.reflected(dynamics.n) * self.speeds(z) ** 2 / 2).sum(axis=-1)
