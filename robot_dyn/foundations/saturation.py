"""Saturation of a command at ±u_max, in three smooth pieces.

    sat(u) = c + min(max(u − c, −l), l)

With c = 0 and l = u_max this is the bound itself; with l = inf, u is unchanged; with l = −u_max it is c − u_max.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.threshold import Threshold

_UPPER, _LOWER = ("upper effort limit", "reached", "left"), ("lower effort limit", "left", "reached")


def saturated(u: Array, limit: Array, middle: Array | None) -> Array:
    """Return sat(u), (..., n), for limit l and middle c; None for c = 0 without reachable limits."""
    if middle is None:
        return np.minimum(np.maximum(u, -limit), limit)
    return middle + np.minimum(np.maximum(u - middle, -limit), limit)


def initial_middle(limit: object) -> float | None:
    """Return the initial middle c of a bound: 0, or None if no limit can be reached or limits are not resolved yet."""
    reachable = isinstance(limit, np.ndarray) and (np.isfinite(limit) & (limit > 0)).any()
    return 0.0 if reachable else None


def limit_thresholds(limit: Array, middle: Array | None, n: int) -> tuple[Threshold, ...]:
    """Return the thresholds at which the actuation of n joints passes ±u_max."""
    return tuple(
        Threshold(i, sign * float(most), *words, of_actuation=True)
        for sign, words in ((1, _UPPER), (-1, _LOWER))
        for i, most in enumerate(np.broadcast_to(limit, n))
        if middle is not None and 0 < most < np.inf
    )


def piece(limit: Array, n: int, sides: Mapping[Threshold, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return limit l and middle c of the bound, both (n,), for the current side of each threshold."""
    limits, middles = np.broadcast_to(limit, n).copy(), np.zeros(n)
    for threshold in sides:
        limits[threshold.joint] = np.inf
    for threshold, side in sides.items():
        if side * threshold.level > 0:
            most = abs(threshold.level)
            limits[threshold.joint], middles[threshold.joint] = -most, threshold.level + most
    return limits, middles
