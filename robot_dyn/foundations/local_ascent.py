"""The largest |f| of a function of the joint positions: random states, and local ascent from the best of them.

A search does not prove a bound: the largest |f| found is a lower bound of the maximum. [Nocedal, Wright 2006, ch. 16]
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

_STEP = 1e-5  # [rad] or [m] of central differences
_STARTS = 3  # states from which a local ascent starts


def search_box(lower: np.ndarray, upper: np.ndarray, types: Sequence[str | None]) -> tuple[np.ndarray, np.ndarray]:
    """Return search bounds within position limits, (n,) each: at most one turn around 0, or ±1 m if prismatic."""
    slides = np.array([kind == "prismatic" for kind in types])
    half = (upper - lower) / 2
    half = np.where(np.isfinite(half) & slides, half, np.minimum(half, np.where(slides, 1.0, np.pi)))
    middle = np.clip(0.0, lower + half, upper - half)
    return np.maximum(lower, middle - half), np.minimum(upper, middle + half)


def largest_found(
    f: Callable[[np.ndarray], np.ndarray], states: np.ndarray, values: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Return the state of the largest |f| found in a box, (n,).

    Args:
        f: Function of states (m, n), with values (m,).
        states: States of the box, (k, n); ascents start from the three with the largest |f|.
        values: f there, (k,).
        low: Lower bounds of the box, (n,).
        high: Upper bounds of the box, (n,).
    """
    from scipy.optimize import minimize

    best = np.argsort(-np.abs(values), kind="stable")[:_STARTS]
    n = states.shape[1]
    steps = _STEP * np.concatenate([np.zeros((1, n)), np.eye(n), -np.eye(n)])
    ends = [*states[best]]
    for start, value in zip(states[best], values[best], strict=True):

        def descent(q: np.ndarray, value: float = value) -> tuple[float, np.ndarray]:
            """Return −f and its gradient by central differences, relative to f at the start."""
            y, up, down = np.split(-f(q + steps) / value, [1, 1 + n])
            return float(y[0]), (up - down) / (2 * _STEP)

        if value != 0:
            end = minimize(descent, start, jac=True, method="L-BFGS-B", bounds=[*zip(low, high, strict=True)])
            ends.append(np.clip(end.x, low, high))
    return ends[int(np.argmax(np.abs(f(np.array(ends)))))]
