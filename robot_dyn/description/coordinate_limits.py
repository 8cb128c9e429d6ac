"""Limits of a coordinate: those of its joint, narrowed by the joints that follow it.

A follower at s q + s₀ stays within [a, b] while q lies between (a − s₀)/s and (b − s₀)/s, and within its speed limit w
while |v| ≤ w/|s|. A coordinate may take the positions and speeds that all joints tied to it allow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import final

from robot_dyn.description.couplings import resolve
from robot_dyn.description.structure import StatedJoint, Structure
from robot_dyn.description.urdf import UNBOUNDED
from robot_dyn.foundations.arithmetic import FLOAT64

# Below this part of the joint's own range, the limits of a follower are ignored: the knuckles of many
# grippers all state the range of one of them.
_LEAST_PART = 0.1
_ROUNDING = 1e-9  # fraction of the range: limits this close are the same, because files state few digits

Interval = tuple[float, float]


@final
@dataclass(frozen=True)
class CoordinateLimit:
    """Position or speed limits of a coordinate.

    Attributes:
        lower: Lower limit, in [rad] or [m], or per second; −inf if there is none.
        upper: Upper limit; inf if there is none.
        narrowed_by: Followers whose own limits are reached before those of the joint.
        exceeded: Interval of each follower that leaves its own limits while the joint stays within its own, by name;
            these limits are not enforced.
    """

    lower: float
    upper: float
    narrowed_by: tuple[str, ...]
    exceeded: dict[str, Interval]


def position_limits(robot: Structure) -> dict[str, CoordinateLimit]:
    """Return the position limits of each coordinate, by the name of its joint."""
    return _limits(robot, _positions)


def speed_limits(robot: Structure) -> dict[str, CoordinateLimit]:
    """Return the limits of each coordinate's velocity, symmetric about 0, by the name of its joint."""
    return _limits(robot, _speeds)


def _positions(joint: StatedJoint) -> Interval:
    return _stated(joint.lower, -inf), _stated(joint.upper, inf)


def _speeds(joint: StatedJoint) -> Interval:
    limit = _stated(joint.velocity, inf)
    return -limit, limit


def _stated(limit: float | None, unstated: float) -> float:
    return unstated if limit is None or abs(limit) >= float(UNBOUNDED) else limit


def _limits(robot: Structure, interval: Callable[[StatedJoint], Interval]) -> dict[str, CoordinateLimit]:
    of_followers: dict[str, dict[str, tuple[Interval, float, float]]] = {name: {} for name in robot.free}
    for name in robot.moving:
        source, ratio, offset = resolve(name, robot.mimics, FLOAT64)
        if name in robot.mimics and ratio != 0:
            shift = offset if interval is _positions else 0.0
            # Python's floats: a quotient beyond their range becomes inf, without a limit
            of_followers[source][name] = interval(robot.joints[name]), float(ratio), float(shift)
    return {name: _intersection(interval(robot.joints[name]), followers) for name, followers in of_followers.items()}


def _intersection(own: Interval, followers: dict[str, tuple[Interval, float, float]]) -> CoordinateLimit:
    """Intersect the range of a joint with those of its followers, unless hardly anything of it would be left."""
    lower, upper = own
    narrow: dict[str, Interval] = {}
    for name, ((a, b), ratio, offset) in followers.items():
        low, high = sorted(((a - offset) / ratio, (b - offset) / ratio))
        width = min(high - low, own[1] - own[0])
        slack = _ROUNDING * width if width < inf else 0.0
        if low > own[0] + slack or high < own[1] - slack:
            narrow[name] = low, high
            lower, upper = max(lower, low), min(upper, high)
    if not narrow:
        return CoordinateLimit(*own, (), {})
    width = own[1] - own[0]
    if upper - lower > (_LEAST_PART * width if width < inf else 0.0):
        reached = tuple(name for name, (low, high) in narrow.items() if low == lower or high == upper)
        return CoordinateLimit(lower, upper, reached, {})
    return CoordinateLimit(*own, (), {name: followers[name][0] for name in narrow})
