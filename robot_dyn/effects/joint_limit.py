"""Joint stops as one-sided springs and dampers: τ = k (δ₋ − δ₊) − c (δ₋ + δ₊) v, with δ the depth past a stop.

The damping grows with the depth, so that the torque is continuous at contact [Hunt, Crossley 1975]. Soft stops are
overrun by about v √(M/k); for rigid ones see `rigid_stops`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, ClassVar, final

import numpy as np

from robot_dyn.effects.effect import Conservative, Dissipative, Effect, require
from robot_dyn.foundations.arithmetic import Array, Scalar, positive_part
from robot_dyn.foundations.coefficients import CoefficientField, coefficient, with_values
from robot_dyn.foundations.errors import EffectError
from robot_dyn.foundations.threshold import Threshold
from robot_dyn.queries.dynamics import Dynamics

if TYPE_CHECKING:
    from robot_dyn.foundations.coefficients import CoefficientInput


_NOWHERE = 1e9  # position of a stop that does not exist
_LOWER_STOP, _UPPER_STOP = ("lower stop", "left", "touched"), ("upper stop", "touched", "left")
LOWER = coefficient("rad", symbol="Lower stop", infinite=True, fill_value=-inf, stated="lower")
UPPER = coefficient("rad", symbol="Upper stop", infinite=True, fill_value=inf, stated="upper")


@dataclass(frozen=True, eq=False)
class _JointStops(Effect):
    """Base class of the two parts of joint stops."""

    lower: CoefficientField = field(metadata=LOWER)
    upper: CoefficientField = field(metadata=UPPER)

    name = "joint_stops"
    through: ClassVar[str]  # the coefficient that acts: a joint where it is 0 has no stops

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("lower", "upper"):
            stop = getattr(self, name)
            if not isinstance(stop, np.ndarray):
                return  # by joint name or "urdf": checked by the plant
            # finite even without a stop, to avoid inf − inf
            stop = np.clip(stop, -_NOWHERE, _NOWHERE)
            stop.setflags(write=False)
            object.__setattr__(self, name, stop)
        lower, upper = self.lower, self.upper
        if np.ndim(lower) == np.ndim(upper) == 1 and len(lower) != len(upper):
            raise EffectError(f"lower must have as many values as upper, got {lower} and {upper}")
        require("lower must be less than upper", np.less, lower, upper)

    @property
    def widths(self) -> tuple[Scalar, Scalar]:
        with np.errstate(divide="ignore"):  # depth at 1 N m or 1 N: relevant loads are larger
            return np.divide(1.0, getattr(self, self.through)), inf

    def thresholds(self, n: int) -> tuple[Threshold, ...]:
        acts = np.broadcast_to(getattr(self, self.through), n) > 0
        return tuple(
            Threshold(i, float(level), *words)
            for words, levels in ((_LOWER_STOP, self.lower), (_UPPER_STOP, self.upper))
            for i, level in enumerate(np.broadcast_to(levels, n))
            if abs(level) < _NOWHERE and acts[i]
        )

    def on_side(self, n: int, sides: Mapping[Threshold, int]) -> Effect:
        """Return the effect without untouched stops; touched ones act on both sides, like springs."""
        lower, upper = np.broadcast_to(self.lower, n).copy(), np.broadcast_to(self.upper, n).copy()
        for joint in {threshold.joint for threshold in sides}:
            lower[joint], upper[joint] = -_NOWHERE, _NOWHERE
        for threshold, side in sides.items():
            if side == (1 if threshold.name == _UPPER_STOP[0] else -1):
                lower[threshold.joint] = upper[threshold.joint] = threshold.level
        return with_values(self, {"lower": lower, "upper": upper})


@final
@dataclass(frozen=True, eq=False)
class JointStopSpring(_JointStops, Conservative):
    """The elastic part of joint stops: τ = k (δ₋ − δ₊), of energy ½ k (δ₋² + δ₊²).

    Attributes:
        lower: Position of the lower stop, −inf for none, a scalar or (n,), in [rad] or [m].
        upper: Position of the upper stop, inf for none, above the lower one.
        stiffness: k, a scalar or (n,), in [N m/rad] or [N/m], not negative.

    Example:
        >>> rd.effects.JointStopSpring(lower=[-1.0, -2.0], upper=1.0, stiffness=50.0)
    """

    stiffness: CoefficientField = field(metadata=coefficient("N m/rad", symbol="k", minimum=0))

    through = "stiffness"
    term = "k (δ₋ − δ₊)"

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        return self.stiffness * (positive_part(self.lower - q) - positive_part(q - self.upper))

    def potential(self, dynamics: Dynamics, t: float, q: Array) -> Array:
        depth = positive_part(self.lower - q) + positive_part(q - self.upper)
        return (self.stiffness * depth**2 / 2).sum(axis=-1)


@final
@dataclass(frozen=True, eq=False)
class JointStopDamper(_JointStops, Dissipative):
    """The dissipative part of joint stops: τ = −c (δ₋ + δ₊) v.

    Attributes:
        lower: Position of the lower stop, −inf for none, a scalar or (n,), in [rad] or [m].
        upper: Position of the upper stop, inf for none, above the lower one.
        damping: c, damping per unit of depth, a scalar or (n,), in [N m s/rad²] or [N s/m²], not negative.

    Example:
        >>> rd.effects.JointStopDamper(lower=[-1.0, -2.0], upper=1.0, damping=20.0)
    """

    damping: CoefficientField = field(
        metadata=coefficient("N m s/rad²", symbol="c, damping per unit of depth", minimum=0)
    )

    through = "damping"
    term = "−c (δ₋ + δ₊) v"

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        return -self.damping * (positive_part(self.lower - q) + positive_part(q - self.upper)) * v


def joint_stops(
    lower: CoefficientInput, upper: CoefficientInput, stiffness: CoefficientInput = 1e4, damping: CoefficientInput = 1e3
) -> tuple[JointStopSpring, JointStopDamper]:
    """Return both parts of joint stops; the limits of a robot are `robot.lower` and `robot.upper`.

    Example:
        >>> rd.effects.joint_stops(lower=[-1.0, -2.0], upper=1.0, stiffness=50.0, damping=20.0)
    """
    return JointStopSpring(lower, upper, stiffness), JointStopDamper(lower, upper, damping)
