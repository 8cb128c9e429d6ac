"""Effects that hold joints: at rest, their torque is the value in an interval that keeps the joint at rest.

    τ ∈ −F(v):   one value if v ≠ 0,   an interval if v = 0

The mode of a run is the set of held joints and the directions in which the others slide. Within a mode the equation of
motion is smooth; the mode changes when a torque would leave its interval, or a velocity reaches 0.
[Moreau 1988; Glocker, Set-Valued Force Laws, 2001]
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from itertools import count
from typing import ClassVar, NamedTuple

import numpy as np

from robot_dyn.effects.effect import Dissipative
from robot_dyn.effects.settling import settle, settling
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.coefficients import OptionalCoefficientField
from robot_dyn.foundations.convex import LARGE, not_found
from robot_dyn.foundations.threshold import smooth


class Interval(NamedTuple):
    """Bounds of the torque on joints at rest, both (n,), in [N m] or [N]; both 0 where the effect does not act."""

    least: np.ndarray
    most: np.ndarray


class Mode(NamedTuple):
    """The held joints, and the directions in which the others slide, all (n,).

    Attributes:
        held: 1 for held joints, 0 for the others.
        direction: 1 or −1 for joints that slide or are about to; 0 for joints that are held or have no dry friction.
        contact: 1 or −1 if the motor of a joint rests at an end of its backlash, else 0; None for 0 everywhere.
    """

    held: np.ndarray
    direction: np.ndarray
    contact: np.ndarray | None = None


class SetValued(Dissipative):
    """An effect with a mode.

    Attributes:
        held: 1 for held joints, 0 for the others, (n,); None before a mode is chosen.
        has_friction: True if it is friction, for time stepping.
        stops: True if it has `bounds`, for time stepping.
    """

    held: OptionalCoefficientField
    has_friction: ClassVar[bool] = False
    stops: ClassVar[bool] = False

    thresholds = smooth  # within a mode

    @abstractmethod
    def in_mode(self, mode: Mode) -> SetValued:
        """Return the effect in a mode of the plant: smooth in q and v."""

    def sliding(self, v: Array) -> Array:
        """Return the friction of sliding joints, not negative, (..., n); 0 by default."""
        return 0 * v

    def friction(self, v: Array) -> Array:
        """Return the largest friction at the velocity at the start of a step, (n,); 0 by default."""
        return 0 * v

    def bounds(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return bounds of the velocity at the end of a step, both (n,), from q at its middle and v at its start."""
        return 0 * v - np.inf, 0 * v + np.inf

    @abstractmethod
    def at_rest(self, q: np.ndarray) -> Interval:
        """Return the interval of the torque on joints of velocity 0; only stops depend on q."""


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
        load: All other torques minus C v and ∂V/∂q, with the friction of sliding joints, (n,).
        q: Position, (n,).
        v: Velocity, (n,).
        forced: Direction of joints at rest that break away, by index.
    """
    n, zero = len(v), np.zeros_like(v)
    intervals = [effect.at_rest(q) for effect in effects]
    least, most = (sum((interval[k] for interval in intervals), start=zero) for k in (0, 1))
    slides = sum((effect.sliding(zero) for effect in effects), start=zero)
    (held, direction), work = np.zeros((2, n)), settling(n)
    work.least[:], work.most[:] = least, most
    for i, way in (forced or {}).items():
        work.forced[i] = way
    with np.errstate(all="ignore"):
        solved = settle(M, load, slides, v, held, direction, work)
    if not solved:
        raise not_found(M, load)
    return work.a, Mode(held, direction)


def friction_and_bounds(effects: Sequence[SetValued], q: Array, v: Array) -> tuple[Array, Array, Array, list[Array]]:
    """Return the largest friction, bounds of v⁺ and shares of effects, for a time step with q at its middle.

    Shares, (n,), distribute friction over several effects with friction, and then bounds over several effects with
    bounds; a single effect has none.
    """
    rub, stop = [[x for x in effects if getattr(x, kind)] for kind in ("has_friction", "stops")]
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


def split_impulses(effects: Sequence[SetValued], rubbing: Array, stopping: Array, shares: Array) -> Iterator[Array]:
    """Yield the impulse of each effect, from the total impulses of friction and stops and the consecutive shares."""
    n = len(rubbing)
    rub, stop = (sum(getattr(x, kind) for x in effects) for kind in ("has_friction", "stops"))
    parts = (shares[k * n : (k + 1) * n] for k in count())
    rub_shares = [next(parts) for _ in range(rub)] if rub > 1 else [np.ones(n)]
    stop_shares = [next(parts) for _ in range(stop)] if stop > 1 else [np.ones(n)]
    rubs, stops = iter(rub_shares), iter(stop_shares)
    for effect in effects:
        impulse = 0 * rubbing
        if effect.has_friction:
            impulse = impulse + next(rubs) * rubbing
        if effect.stops:
            impulse = impulse + next(stops) * stopping
        yield impulse
