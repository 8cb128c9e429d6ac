"""Rigid joint stops: a joint never passes them; it bounces with a restitution, or comes to rest there."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import final

import numpy as np

from robot_dyn.effects.effect import require
from robot_dyn.effects.joint_limit import LOWER, UPPER
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

_NEAR = 4e-15  # precision of located events, relative to the stop if that exceeds 1 in its unit, otherwise absolute


@final
@dataclass(frozen=True, eq=False)
class RigidStops(SetValued):
    """Stops that are never passed: lower ≤ q ≤ upper, with Newton's law of impact, v⁺ = −e v⁻.

    Simultaneous impacts and contacts are solved together, and no impact adds energy. At rest at a stop the torque may
    have any size, directed away from it. [Moreau 1988; Glocker, Set-Valued Force Laws, 2001]

    Attributes:
        lower: Position of the lower stop, −inf for none, a scalar or (n,), in [rad] or [m]; "urdf" for the limits of
            the robot's file, "urdf_soft" for its soft limits.
        upper: Position of the upper stop, inf for none, above the lower one.
        restitution: e, a scalar or (n,), 0 to 1; 0 by default.

    Example:
        >>> rd.effects.RigidStops(lower=-1.0, upper=[1.0, 2.0], restitution=0.3)
    """

    lower: CoefficientField = field(metadata=LOWER)
    upper: CoefficientField = field(metadata=UPPER)
    restitution: CoefficientField = field(default=default(0.0), metadata=coefficient(symbol="e", minimum=0))

    held: OptionalCoefficientField = field(
        default=default(None), init=False, repr=False, metadata=coefficient(can_vary=False)
    )

    stops = True
    term = "lower ≤ q ≤ upper, v⁺ = −e v⁻"

    def __post_init__(self) -> None:
        super().__post_init__()
        require("restitution must not be greater than 1", lambda e: e <= 1, self.restitution)
        require("lower must be less than upper", np.less, self.lower, self.upper)

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        return 0 * v

    def in_mode(self, mode: Mode) -> RigidStops:
        return with_values(self, {"held": mode.held})

    def at_rest(self, q: np.ndarray) -> Interval:
        side = self.touched(q)
        return Interval(np.where(side > 0, -inf, 0.0), np.where(side < 0, inf, 0.0))

    def bounds(self, q: Array, v: Array) -> tuple[Array, Array]:
        # Newton's law for joints that approach; a joint that leaves is at most reversed, so that r (v + v⁺) / 2 is 0
        back = -self.restitution * v
        lower = np.where(q <= self.lower + 0 * q, np.minimum(back, -v), 0 * v - inf)
        return lower, np.where(q >= self.upper + 0 * q, np.maximum(back, -v), 0 * v + inf)

    def touched(self, q: np.ndarray) -> np.ndarray:
        """Return −1 for joints at or past the lower stop, to rounding, 1 for the upper stop, 0 for others, (n,)."""
        lower, upper = (touching(level, side) for level, side in zip(self._levels(q), (-1, 1), strict=True))
        return np.where(q <= lower, -1, np.where(q >= upper, 1, 0))

    def penetration(self, q: np.ndarray) -> np.ndarray:
        """Return the depth of each joint past a stop, (n,); 0 if it is within rounding."""
        lower, upper = self._levels(q)
        depth = np.maximum(lower - q, q - upper)
        return np.where(depth > _near(np.where(q < lower, lower, upper)), depth, 0.0)

    def snapped(self, q: np.ndarray) -> np.ndarray:
        """Return the position, with joints that touch a stop moved exactly to it."""
        lower, upper = self._levels(q)
        side = self.touched(q)
        return np.where(side < 0, lower, np.where(side > 0, upper, q))

    def _levels(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.broadcast_to(self.lower, q.shape), np.broadcast_to(self.upper, q.shape)


def touching(level: np.ndarray, side: int) -> np.ndarray:
    """Return the positions from which stops at these levels, on one side, count as touched."""
    return level - side * _near(level)


def _near(level: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(level), _NEAR * np.maximum(1.0, np.abs(level)), 0.0)
