"""Fixed-point iteration x ← Φ(x), for the stages of implicit methods, carried to where rounding ends it.

An iteration that is cut off earlier, at a tolerance, adds an error with a sign, and energy drifts. [Hairer, Lubich,
Wanner, Geometric Numerical Integration, 2nd ed., 2006, VIII.6]
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite
from typing import Any

import numpy as np

from robot_dyn.arithmetic import Array, midpoint, radius
from robot_dyn.errors import OverflowedError

MOST_ITERATIONS = 100  # so the iteration must gain a binary digit in two rounds, to end in float64
PATIENCE = 2  # rounds: where q' = v and v' = −k q, increments shrink only every second one
NOISE = 1e3  # roundings of the largest entry that an increment may keep, as where forces cancel
INFLATED_ROUNDING = float(np.finfo(np.float64).eps) ** (2 / 3)  # see below; in float64
_INFLATION = 1.1  # Rump's ε-inflation: more than the rounding, less than 1 / the rate of contraction


def fixed_point(update: Callable[[Array], Array], x: Array, y: Array) -> Array | None:
    """Iterate x ← Φ(x) until the increments of no entry shrink any more.

    Entries count apart, so that one in a large unit does not end the iteration of the others.

    Args:
        update: Φ. In balls, only the midpoints of what it returns are used.
        x: Where to start, floats or exact balls, shape (..., m).
        y: The state that x is a change of, shape (..., m); taken to be of size 1 at least in some entry.

    Returns:
        The last iterate; None if increments overflow, or do not stagnate at rounding size within MOST_ITERATIONS.
    """
    u = _unit_roundoff(x)
    size = _sizes(y)
    slack = NOISE * u * max(1.0, size.max())
    least, stale = np.full(x.shape[-1], inf), 0
    for _ in range(MOST_ITERATIONS):
        try:
            new = _exact(update(x))
        except OverflowedError:
            return None
        increment, x = _sizes(new - x), new
        largest = increment.max()
        if not isfinite(largest):
            return None
        own = _sizes(x)
        stale = 0 if ((increment < least) & (increment > u * own)).any() else stale + 1
        least = np.minimum(increment, least)
        # an increment of some power of u between 1/2 and 1 is rounding of Φ: far below any error that matters
        if largest == 0 or (stale >= PATIENCE and (increment <= slack + u ** (2 / 3) * (size + own)).all()):
            return x
    return None


def enclose_fixed_point(update: Callable[[Array], Array], x: Array) -> Array | None:
    """Balls that certainly hold a fixed point of Φ, near an approximate one.

    A box that Φ maps into its own interior holds a fixed point, by Brouwer's theorem; so does every further image.

    Args:
        update: Φ, in balls.
        x: Exact balls near the fixed point.

    Returns:
        The enclosure; None if no box is mapped into itself within MOST_ITERATIONS.

    Source: Rump, Verification methods, Acta Numerica 19, 2010, section 13.
    """
    box = update(x)
    for _ in range(MOST_ITERATIONS):
        wide = _inflate(box)
        box = update(wide)
        if all(outer.contains_interior(inner) for outer, inner in zip(wide.flat, box.flat, strict=True)):
            break
    else:
        return None
    for _ in range(MOST_ITERATIONS):
        closer = update(box)
        if not (radius(closer) < 0.9 * radius(box)).any():
            break
        box = closer
    return box


def _inflate(box: Array) -> Array:
    """Each ball a little wider, and an exact one no longer so."""
    from flint import arb

    least = 8 * _unit_roundoff(box) * max(_sizes(box).max(), 1e-300)
    result = np.empty_like(box)
    result.flat = [arb(ball.mid(), _INFLATION * float(ball.rad().upper()) + least) for ball in box.flat]
    return result


def _exact(x: Array) -> Array:
    if x.dtype != object:
        return x
    return np.vectorize(lambda ball: ball.mid(), otypes=[object])(x)


def _sizes(x: Array) -> np.ndarray:
    """Largest absolute value of each entry over stages and batch, shape (m,)."""
    return np.abs(x if x.dtype != object else midpoint(x)).reshape(-1, x.shape[-1]).max(axis=0)


def _unit_roundoff(x: Array) -> Any:
    if x.dtype != object:
        return np.finfo(x.dtype).eps
    from flint import ctx

    return 2.0**-ctx.prec
