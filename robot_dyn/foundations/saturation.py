"""Saturation: what is requested is cut at ±u_max; in three pieces, each smooth.

    sat(u) = c + min(max(u − c, −l), l)

With c = 0 and l = u_max it is the bound itself; with l = inf u passes; with l = −u_max it is the constant c − u_max.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.threshold import Threshold

_UPPER, _LOWER = ("upper effort limit", "reached", "left"), ("lower effort limit", "left", "reached")


def saturated(u: Array, limit: Array, middle: Array | None) -> Array:
    """sat(u), (..., n), with limit l and middle c; None for c = 0 where nothing is ever cut."""
    if middle is None:
        return np.minimum(np.maximum(u, -limit), limit)
    return middle + np.minimum(np.maximum(u - middle, -limit), limit)


def middle_of(limit: Any) -> float | None:
    """The middle of a bound as stated: 0, or None where no limit can be reached, or none is known yet."""
    known = isinstance(limit, np.ndarray) and (np.isfinite(limit) & (limit > 0)).any()
    return 0.0 if known else None


def limits_reached(limit: Array, middle: Array | None, n: int) -> tuple[Threshold, ...]:
    """Where the actuation of n joints passes ±u_max."""
    return tuple(
        Threshold(i, sign * float(most), *words, of_actuation=True)
        for sign, words in ((1, _UPPER), (-1, _LOWER))
        for i, most in enumerate(np.broadcast_to(limit, n))
        if middle is not None and 0 < most < np.inf
    )


def piece(limit: Array, n: int, sides: Mapping[Threshold, int]) -> tuple[np.ndarray, np.ndarray]:
    """Limit and middle, (n,) each, of the bound on those sides of its thresholds."""
    limits, middles = np.broadcast_to(limit, n).copy(), np.zeros(n)
    for each in sides:
        limits[each.joint] = np.inf
    for each, side in sides.items():
        if side * each.level > 0:
            most = abs(each.level)
            limits[each.joint], middles[each.joint] = -most, each.level + most
    return limits, middles
