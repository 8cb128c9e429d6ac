"""Limits of actuators: |u| ≤ u_max, and the lag u' = (u_command − u) / T."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from operator import attrgetter
from typing import TYPE_CHECKING, Any, final

from robot_dyn.effects.effect import Bound, Effect, Stateful
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.coefficients import (
    URDF,
    CoefficientField,
    OptionalCoefficientField,
    coefficient,
    default,
    with_values,
)
from robot_dyn.foundations.errors import EffectError
from robot_dyn.foundations.saturation import initial_middle, limit_thresholds, piece, saturated
from robot_dyn.foundations.threshold import Threshold, smooth
from robot_dyn.queries.dynamics import Dynamics

if TYPE_CHECKING:
    import numpy as np


@final
@dataclass(frozen=True, eq=False)
class EffortLimit(Bound):
    """Saturation of the actuation at effort limits: −u_max ≤ u ≤ u_max.

    Attributes:
        limit: u_max, a scalar or (n,), inf for none, in [N m] or [N], not negative; "urdf" for the limits in the
            robot's file, which must not be 0.

    Example:
        >>> rd.effects.EffortLimit(limit=[3.0, 2.0])
    """

    limit: CoefficientField = field(
        metadata=coefficient("N m", symbol="u_max", minimum=0, infinite=True, fill_value=inf, stated="effort_limit")
    )

    _middle: OptionalCoefficientField = field(
        default=default(None), init=False, repr=False, metadata=coefficient("N m", can_vary=False)
    )

    term = "|u| ≤ u_max"
    largest = property(attrgetter("limit"))  # pyright: ignore[reportIncompatibleMethodOverride]

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "_middle", initial_middle(self.limit))

    def thresholds(self, n: int) -> tuple[Threshold, ...]:
        return limit_thresholds(self.limit, self._middle, n)

    def on_side(self, n: int, sides: Mapping[Threshold, int]) -> EffortLimit:
        limit, middle = piece(self.limit, n, sides)
        return with_values(self, {"limit": limit, "_middle": middle})

    def on(self, dynamics: Dynamics) -> Effect:
        resolved = super().on(dynamics)
        if self.limit is URDF:
            stated_efforts(dynamics)  # raises for limits of 0
        return resolved

    def actuation(self, u: Array) -> Array:
        return saturated(u, self.limit, self._middle)


@final
@dataclass(frozen=True, eq=False)
class ActuatorLag(Stateful, Bound):
    """First-order lag of the actuation: u' = (u_command − u) / T, from u = 0.

    Bounds listed before it in a plant act on the command, bounds listed after it on u.

    Attributes:
        time_constant_s: T, a scalar or (n,), in [s], positive.

    Example:
        >>> rd.effects.ActuatorLag(time_constant_s=[0.02, 0.05])
    """

    time_constant_s: CoefficientField = field(metadata=coefficient("s", symbol="T", exclusive_minimum=0))

    term = "u' = (u_command − u) / T"
    thresholds = smooth

    def state_size(self, n: int) -> int:
        return n

    def state_rate(self, dynamics: Dynamics, t: float, q: Array, v: Array, u: Array, z: Array) -> Array:
        return (u - z) / self.time_constant_s

    def actuation(  # pyright: ignore[reportIncompatibleMethodOverride]  with its states
        self, u: Array, z: Array
    ) -> Array:
        return z


def stated_efforts(dynamics: Dynamics) -> np.ndarray:
    """Return the effort limits in the file of a robot, (n,), inf for none, in [N m] or [N].

    Raises:
        EffectError: If one is 0, which files use for an unknown limit: the joint would have no actuation.
    """
    robot: Any = dynamics
    if names := [name for name, limit in zip(robot.joint_names, robot.effort_limit, strict=True) if limit == 0]:
        listed = ", ".join(map(repr, names[:6])) + (", …" if len(names) > 6 else "")
        raise EffectError(
            f"the file states an effort limit of 0 for {listed}, so no controller could move these joints; give limits"
            f" by joint, for example {{{names[0]!r}: 87.0}}, or {{{names[0]!r}: 0}} for a passive joint; omitted joints"
            " have no limit"
        )
    return robot.effort_limit
