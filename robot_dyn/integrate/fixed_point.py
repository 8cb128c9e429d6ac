"""Fixed-point iteration x ← Φ(x), for the stages of implicit methods, continued until rounding ends it.

An iteration that stops earlier, at a tolerance, adds a systematic error, and energy drifts. [Hairer, Lubich,
Wanner, Geometric Numerical Integration, 2nd ed., 2006, VIII.6]
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from robot_dyn.foundations.arithmetic import Array, midpoint, radius
from robot_dyn.integrate.primitives import MOST_ITERATIONS

_INFLATION = 1.1  # Rump's ε-inflation: more than the rounding, less than 1 / the rate of contraction


def enclose_fixed_point(update: Callable[[Array], Array], x: Array) -> Array | None:
    """Return balls that certainly contain a fixed point of Φ, near an approximate one.

    A box that Φ maps into its interior contains a fixed point, by Brouwer's theorem; so does every further image.

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
    """Return slightly wider balls, of positive radius."""
    from flint import arb

    least = 8 * unit_roundoff(box) * max(_sizes(box).max(), 1e-300)
    result = np.empty_like(box)
    result.flat = [arb(ball.mid(), _INFLATION * float(ball.rad().upper()) + least) for ball in box.flat]
    return result


def _sizes(x: Array) -> np.ndarray:
    """Largest absolute value of each entry over stages and batch, shape (m,)."""
    return np.abs(x if x.dtype != object else midpoint(x)).reshape(-1, x.shape[-1]).max(axis=0)


def unit_roundoff(x: Array) -> Any:
    """Return the unit roundoff of the arithmetic of an array."""
    if x.dtype != object:
        return np.finfo(x.dtype).eps
    from flint import ctx

    return 2.0**-ctx.prec
