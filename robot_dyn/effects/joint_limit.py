"""Joint stops as one-sided spring and damper: τ = k (δ₋ − δ₊) − c (δ₋ + δ₊) v, with δ the depth beyond a stop.

The damping grows with the depth, so that the torque is continuous at contact [Hunt, Crossley 1975]. Soft stops are
overrun by about v √(M/k); rigid ones are set-valued and no part of these.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, final

import numpy as np

from robot_dyn.arithmetic import Array, positive_part
from robot_dyn.coefficients import coefficient, with_values
from robot_dyn.effects.effect import Conservative, Dissipative
from robot_dyn.errors import EffectError
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.threshold import Threshold

_NOWHERE = 1e9  # a stop that does not exist: no depth can be reached there
_NAME = "joint_stops"  # of both parts, as of the function that makes them
_LOWER_STOP, _UPPER_STOP = ("lower stop", "left", "touched"), ("upper stop", "touched", "left")
_LOWER = coefficient("rad", symbol="Lower stop", infinite=True, elsewhere=-inf, stated="lower")
_UPPER = coefficient("rad", symbol="Upper stop", infinite=True, elsewhere=inf, stated="upper")


@final
@dataclass(frozen=True, eq=False)
class JointStopSpring(Conservative):
    """The elastic part of joint stops: τ = k (δ₋ − δ₊), of energy ½ k (δ₋² + δ₊²).

    Attributes:
        lower: Position of the lower stop, −inf for none, a scalar or (n,), in [rad] or [m].
        upper: Position of the upper stop, inf for none, above the lower one.
        stiffness: k, a scalar or (n,), in [N m/rad] or [N/m], not negative.
    """

    lower: Any = field(metadata=_LOWER)
    upper: Any = field(metadata=_UPPER)
    stiffness: Any = field(metadata=coefficient("N m/rad", symbol="k", least=0))

    term = "k (δ₋ − δ₊)"

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_stops(self)

    @property
    def name(self) -> str:
        return _NAME

    @property
    def widths(self) -> tuple[Any, Any]:
        return _depth(self.stiffness), inf

    def thresholds(self, n: int) -> tuple[Threshold, ...]:
        return _thresholds(self, self.stiffness, n)

    def beyond(self, n: int, sides: Mapping[Threshold, int]) -> JointStopSpring:
        return with_values(self, _levels(self, n, sides))

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        return self.stiffness * (positive_part(self.lower - q) - positive_part(q - self.upper))

    def potential(self, dynamics: Dynamics, t: float, q: Array) -> Array:
        depth = positive_part(self.lower - q) + positive_part(q - self.upper)
        return (self.stiffness * depth**2 / 2).sum(axis=-1)


@final
@dataclass(frozen=True, eq=False)
class JointStopDamper(Dissipative):
    """The dissipative part of joint stops: τ = −c (δ₋ + δ₊) v.

    Attributes:
        lower: Position of the lower stop, as of the spring.
        upper: Position of the upper stop.
        damping: c, damping for each unit of depth, a scalar or (n,), in [N m s/rad²] or [N s/m²], not negative.
    """

    lower: Any = field(metadata=_LOWER)
    upper: Any = field(metadata=_UPPER)
    damping: Any = field(metadata=coefficient("N m s/rad²", symbol="c, damping for each unit of depth", least=0))

    term = "−c (δ₋ + δ₊) v"

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_stops(self)

    @property
    def name(self) -> str:
        return _NAME

    @property
    def widths(self) -> tuple[Any, Any]:
        return _depth(self.damping), inf

    def thresholds(self, n: int) -> tuple[Threshold, ...]:
        return _thresholds(self, self.damping, n)

    def beyond(self, n: int, sides: Mapping[Threshold, int]) -> JointStopDamper:
        return with_values(self, _levels(self, n, sides))

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        return -self.damping * (positive_part(self.lower - q) + positive_part(q - self.upper)) * v


def joint_stops(
    lower: Any, upper: Any, stiffness: Any = 1e4, damping: Any = 1e3
) -> tuple[JointStopSpring, JointStopDamper]:
    """Both parts of joint stops; the limits of a robot are `robot.lower` and `robot.upper`."""
    return JointStopSpring(lower, upper, stiffness), JointStopDamper(lower, upper, damping)


def _depth(coefficient: Any) -> Any:
    """The depth at which a stop holds 1 N m or 1 N: a load that matters lies deeper than a small part of it."""
    with np.errstate(divide="ignore"):
        return np.divide(1.0, coefficient)


def _thresholds(stops: Any, coefficient: Any, n: int) -> tuple[Threshold, ...]:
    acts = np.broadcast_to(coefficient, n) > 0
    return tuple(
        Threshold(i, float(level), *words)
        for words, levels in ((_LOWER_STOP, stops.lower), (_UPPER_STOP, stops.upper))
        for i, level in enumerate(np.broadcast_to(levels, n))
        if abs(level) < _NOWHERE and acts[i]
    )


def _levels(stops: Any, n: int, sides: Mapping[Threshold, int]) -> dict[str, np.ndarray]:
    """A stop that is not touched lies nowhere; of one that is, the depth goes on to both sides, as of a spring."""
    lower, upper = np.broadcast_to(stops.lower, n).copy(), np.broadcast_to(stops.upper, n).copy()
    for joint in {each.joint for each in sides}:
        lower[joint], upper[joint] = -_NOWHERE, _NOWHERE
    for each, side in sides.items():
        if side == (1 if each.name == _UPPER_STOP[0] else -1):
            lower[each.joint] = upper[each.joint] = each.level
    return {"lower": lower, "upper": upper}


def _check_stops(stops: Any) -> None:
    for name in ("lower", "upper"):
        stop = getattr(stops, name)
        if not isinstance(stop, np.ndarray):
            return  # by name, or as the file states: checked when the joints are known
        # A stop that does not exist lies where no depth can be reached, and inf − inf is avoided.
        stop = np.clip(stop, -_NOWHERE, _NOWHERE)
        stop.setflags(write=False)
        object.__setattr__(stops, name, stop)
    if np.ndim(stops.lower) == np.ndim(stops.upper) == 1 and len(stops.lower) != len(stops.upper):
        raise EffectError(f"lower and upper stops must be of the same joints, got {stops.lower} and {stops.upper}")
    if not np.all(stops.lower < stops.upper):
        raise EffectError(f"lower stops must lie below upper ones, got {stops.lower} and {stops.upper}")
