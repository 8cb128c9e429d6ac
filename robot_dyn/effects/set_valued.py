"""Effects that hold joints: at rest their torque may be any of an interval, and is the one that keeps the joint there.

    τ ∈ −F(v):   one value where v ≠ 0,   an interval where v = 0

The mode of a run is which joints they hold, and in which direction the others slide. Within a mode the equation of
motion is smooth; where a torque would leave its interval, or a velocity reaches 0, the mode changes.
[Moreau 1988; Glocker, Set-Valued Force Laws, 2001]
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from itertools import count
from typing import Any, ClassVar, NamedTuple

import numpy as np

from robot_dyn.effects.effect import Dissipative
from robot_dyn.effects.settling import settle, settling
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.convex import LARGE, not_found
from robot_dyn.foundations.threshold import smooth


class Interval(NamedTuple):
    """Bounds of the torque on joints at rest, each (n,), in [N m] or [N]; (0, 0) where the effect does not act."""

    least: np.ndarray
    most: np.ndarray


class Mode(NamedTuple):
    """Which joints are held, and in which direction the others slide, each (n,).

    Attributes:
        held: 1 for each joint that is held, 0 for the others.
        direction: 1 or −1 for each joint that slides or is about to; 0 for held ones and those that nothing holds.
        contact: 1 or −1 where the motor of a joint rests at an end of its backlash, else 0; None for 0 everywhere.
    """

    held: np.ndarray
    direction: np.ndarray
    contact: np.ndarray | None = None


class SetValued(Dissipative):
    """An effect with a mode.

    Attributes:
        held: 1 for each joint that is held and 0 for the others, (n,); None before a mode is chosen.
        rubs, stops: Whether it is friction, and whether it has `bounds`, for time stepping.
    """

    held: Any
    rubs: ClassVar[bool] = False
    stops: ClassVar[bool] = False

    thresholds = smooth  # within a mode

    @abstractmethod
    def in_mode(self, mode: Mode) -> SetValued:
        """Return the effect in a mode of the plant: smooth in q and v."""

    def sliding(self, v: Array) -> Array:
        """Friction of sliding joints, not negative, (..., n); 0 by default."""
        return 0 * v

    def friction(self, v: Array) -> Array:
        """Greatest friction, at the velocity at the start of a step, (n,)."""
        return 0 * v

    def bounds(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Bounds of the velocity at the end of a step, each (n,), from its middle q and the velocity at its start."""
        return 0 * v - np.inf, 0 * v + np.inf

    @abstractmethod
    def at_rest(self, q: np.ndarray) -> Interval:
        """Interval of its torque on joints of velocity 0, at q; it depends on q for stops alone."""


def settled(
    effects: Sequence[SetValued],
    M: np.ndarray,
    load: np.ndarray,
    q: np.ndarray,
    v: np.ndarray,
    forced: Mapping[int, int] | None = None,
) -> tuple[np.ndarray, Mode]:
    """Return the acceleration of least constraint, (n,), and the mode that follows; see `settling`.

    Joints that stay at rest have exactly 0.

    Args:
        effects: The set-valued effects.
        M: Mass matrix, (n, n).
        load: All other torques less C v and ∂V/∂q, with the friction of the joints that slide, (n,).
        q: Position, (n,).
        v: Velocity, (n,).
        forced: The direction of joints at rest that are known to break away.
    """
    n, zero = len(v), np.zeros_like(v)
    intervals = [each.at_rest(q) for each in effects]
    least, most = (sum((each[k] for each in intervals), start=zero) for k in (0, 1))
    slides = sum((each.sliding(zero) for each in effects), start=zero)
    (held, direction), room = np.zeros((2, n)), settling(n)
    room.least[:], room.most[:] = least, most
    for i, way in (forced or {}).items():
        room.forced[i] = way
    with np.errstate(all="ignore"):
        solved = settle(M, load, slides, v, held, direction, room)
    if not solved:
        raise not_found(M, load)
    return room.a, Mode(held, direction)


def in_a_step(effects: Sequence[SetValued], q: Array, v: Array) -> tuple[Array, Array, Array, list[Array]]:
    """Greatest friction, bounds of v⁺, and shares of effects, for a step of time stepping with the middle q.

    Shares are those of each of several effects with friction in it, and of each of several with bounds, (n,).
    """
    rub, stop = [[x for x in effects if getattr(x, of)] for of in ("rubs", "stops")]
    levels, bounds = [x.friction(v) for x in rub], [x.bounds(q, v) for x in stop]
    friction = sum(levels, start=0 * v)
    lower, upper = 0 * v - np.inf, 0 * v + np.inf
    for low, high in bounds:
        lower, upper = np.maximum(lower, low), np.minimum(upper, high)
    shares: list[Array] = []
    if len(rub) > 1:
        shares += [np.where(friction > 0, level / np.where(friction > 0, friction, 1.0), 0 * v) for level in levels]
    if len(stop) > 1:
        left = 1 + 0 * v
        for low, high in bounds:
            below = np.logical_and(low > -LARGE, low >= lower)
            touches = np.logical_or(below, np.logical_and(high < LARGE, high <= upper))
            shares.append(np.where(touches, left, 0 * v))
            left = left - shares[-1]
    return friction, lower, upper, shares


def impulses_of(effects: Sequence[SetValued], rubbing: Array, stopping: Array, shares: Array) -> Iterator[Array]:
    """Impulse of each effect, from the total impulses of friction and of stops, by consecutive shares."""
    n = len(rubbing)
    rub, stop = (sum(getattr(x, of) for x in effects) for of in ("rubs", "stops"))
    each_n = (shares[k * n : (k + 1) * n] for k in count())
    of_rub = [next(each_n) for _ in range(rub)] if rub > 1 else [np.ones(n)]
    of_stop = [next(each_n) for _ in range(stop)] if stop > 1 else [np.ones(n)]
    rubs, stops = iter(of_rub), iter(of_stop)
    for each in effects:
        impulse = 0 * rubbing
        if each.rubs:
            impulse = impulse + next(rubs) * rubbing
        if each.stops:
            impulse = impulse + next(stops) * stopping
        yield impulse
