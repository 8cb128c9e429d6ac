"""Dry friction with sticking: τ = −f(|v|) sign(v) while a joint slides, and up to ±f_s while it rests."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import final

import numpy as np

from robot_dyn.effects.effect import require
from robot_dyn.effects.set_valued import Interval, Mode, SetValued
from robot_dyn.foundations.arithmetic import Array, Scalar
from robot_dyn.foundations.coefficients import (
    CoefficientField,
    OptionalCoefficientField,
    coefficient,
    default,
    with_values,
)
from robot_dyn.foundations.errors import EffectError
from robot_dyn.queries.dynamics import Dynamics


@final
@dataclass(frozen=True, eq=False)
class DryFriction(SetValued):
    """Coulomb friction: τ = −f sign(v) if v ≠ 0; if v = 0, the torque |τ| ≤ f_s that keeps the joint at rest.

    A joint at rest stays exactly there while the load does not exceed f_s. Then it slides, with f = f_c or, if v_s is
    given, by Stribeck's curve f = f_c + (f_s − f_c) exp(−(v/v_s)²). If f_s > f_c, both rest and sliding solve the
    equations for some loads: a joint at rest then stays at rest.
    [Armstrong-Hélouvry, Dupont, Canudas de Wit, A survey of models, analysis tools and compensation methods for the
    control of machines with friction, 1994]

    The acceleration of a plant accounts for sticking; its N, torque and inverse dynamics use 0 for the friction of a
    joint at rest, which depends on the load.

    Attributes:
        coulomb: f_c, sliding friction, a scalar or (n,), in [N m] or [N], not negative.
        static: f_s, static friction, not less than f_c; f_c by default.
        stribeck_velocity: v_s, a scalar or (n,), in [rad/s] or [m/s], positive; without it friction drops
            from f_s to f_c when sliding starts.

    Example:
        >>> rd.effects.DryFriction(coulomb=[0.4, 0.2], static=0.6, stribeck_velocity=0.1)
    """

    coulomb: CoefficientField = field(metadata=coefficient("N m", symbol="f_c", minimum=0, stated="friction"))
    static: OptionalCoefficientField = field(
        default=default(None), metadata=coefficient("N m", symbol="f_s", minimum=0)
    )
    stribeck_velocity: OptionalCoefficientField = field(
        default=default(None), metadata=coefficient("rad/s", symbol="v_s", exclusive_minimum=0, fill_value=1.0)
    )

    held: OptionalCoefficientField = field(
        default=default(None), init=False, repr=False, metadata=coefficient(can_vary=False)
    )
    _direction: OptionalCoefficientField = field(
        default=default(None), init=False, repr=False, metadata=coefficient(can_vary=False)
    )

    has_friction = True
    term = "−f(v) sign(v); |τ| ≤ f_s at v = 0"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stribeck_velocity is not None and self.static is None:
            raise EffectError("stribeck_velocity has no effect without static, the static friction; give both")
        require("static must not be less than coulomb", np.greater_equal, self.static, self.coulomb)

    @property
    def widths(self) -> tuple[Scalar, Scalar]:
        if self.static is None or self.stribeck_velocity is None:
            return inf, inf
        return inf, np.where(np.greater(self.static, self.coulomb), self.stribeck_velocity, inf)

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        direction = np.sign(v) if self._direction is None else self._direction
        return -self.sliding(v) * direction

    def sliding(self, v: Array) -> Array:
        """Return the sliding friction, f(v)."""
        if self.static is None or self.stribeck_velocity is None:
            return self.coulomb + 0 * v
        return self.coulomb + (self.static - self.coulomb) * np.exp(-((v / self.stribeck_velocity) ** 2))

    def friction(self, v: Array) -> Array:
        return np.where(np.abs(v) > 0, self.sliding(v), self._static + 0 * v)

    @property
    def _static(self) -> Array:
        """The load at which a joint starts to slide, f_s."""
        return self.coulomb if self.static is None else self.static

    def in_mode(self, mode: Mode) -> DryFriction:
        return with_values(self, {"held": mode.held, "_direction": mode.direction})

    def at_rest(self, q: np.ndarray) -> Interval:
        most = np.broadcast_to(np.asarray(self._static, float), q.shape).copy()
        return Interval(-most, most)
