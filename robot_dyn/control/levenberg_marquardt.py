"""Levenberg–Marquardt within bounds: minimise ½‖e(q)‖² over lower ≤ q ≤ upper, from many starts in parallel.

    d = Jᵀ (J Jᵀ + λ 1)⁻¹ e,   λ = μ ‖e‖²,   q⁺ = min(max(q + d, lower), upper)

J omits the columns of joints that Jᵀ e pushes against a bound. μ decreases after steps that reduce e as J predicts, and
increases after others (Nielsen). As e tends to 0, λ tends to 0 like its square, so convergence is quadratic.

[Yamashita, Fukushima, On the rate of convergence of the Levenberg–Marquardt method, 2001; Kanzow, Yamashita, Fukushima,
Levenberg–Marquardt methods with strong local convergence properties for solving nonlinear equations with convex
constraints, 2004; Nielsen, Damping parameter in Marquardt's method, 1999]
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

_START = 1e-2  # initial μ
_MIN, _MAX = 1e-12, 1e16  # range of μ; above it, no step descends
_ROUNDING = 1e-13  # relative to the trace of J Jᵀ: keeps the solve regular if rows of J are dependent

Residual = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


class Descent(NamedTuple):
    """The results of B starts.

    Attributes:
        q: Final positions, (B, n).
        e: Residuals at q, (B, m).
        J: −∂e/∂q at q, (B, m, n).
        iterations: Number of evaluations of e, (B,).
    """

    q: np.ndarray
    e: np.ndarray
    J: np.ndarray
    iterations: np.ndarray


def descend(
    residual: Residual, q: np.ndarray, lower: np.ndarray, upper: np.ndarray, *, tolerance: float, most: int
) -> Descent:
    """Descend from each row of q until ‖e‖ ≤ tolerance, no step descends, or `most` evaluations are spent.

    Args:
        residual: Function of positions, (b, n), and their rows in q, (b,); returns e, (b, m), and −∂e/∂q, (b, m, n).
        q: Starts within the bounds, (B, n).
        lower: Lower bounds, (n,), −inf for none.
        upper: Upper bounds, (n,), inf for none.
        tolerance: Bound on ‖e‖.
        most: Largest number of evaluations for each start.
    """
    q, rows = q.copy(), np.arange(len(q))
    e, J = residual(q, rows)
    mu, factor, iterations = np.full(len(q), _START), np.full(len(q), 2.0), np.ones(len(q), int)
    for _ in range(1, most):
        rows = rows[(_square(e[rows]) > tolerance**2) & (mu[rows] < _MAX)]
        if not len(rows):
            break
        here, old, slope = q[rows], e[rows], J[rows]
        trial = np.clip(here + _step(here, old, slope, lower, upper, mu[rows]), lower, upper)
        new, slope_trial = residual(trial, rows)
        predicted = _square(old) - _square(old - (slope @ (trial - here)[..., None])[..., 0])
        gain = (_square(old) - _square(new)) / np.where(predicted > 0, predicted, np.inf)
        good = gain > 0
        q[rows[good]], e[rows[good]], J[rows[good]] = trial[good], new[good], slope_trial[good]
        change = np.where(good, np.maximum(0.1, 1 - (2 * gain - 1) ** 3), factor[rows])
        mu[rows] = np.maximum(mu[rows] * change, _MIN)
        factor[rows] = np.where(good, 2.0, 2 * factor[rows])
        iterations[rows] += 1
    return Descent(q, e, J, iterations)


def at_bound(q: np.ndarray, e: np.ndarray, J: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Return True for joints at a bound that the descent direction Jᵀ e pushes against, (..., n)."""
    pull = np.swapaxes(J, -1, -2) @ e[..., None]
    return ((q <= lower) & (pull[..., 0] < 0)) | ((q >= upper) & (pull[..., 0] > 0))


def _step(
    q: np.ndarray, e: np.ndarray, J: np.ndarray, lower: np.ndarray, upper: np.ndarray, mu: np.ndarray
) -> np.ndarray:
    J = np.where(at_bound(q, e, J, lower, upper)[:, None, :], 0, J)
    A = J @ np.swapaxes(J, 1, 2)
    damping = mu * _square(e) + _ROUNDING * np.trace(A, axis1=1, axis2=2) + np.finfo(float).tiny
    A = A + damping[:, None, None] * np.eye(A.shape[-1])
    return (np.swapaxes(J, 1, 2) @ np.linalg.solve(A, e[..., None]))[..., 0]


def _square(e: np.ndarray) -> np.ndarray:
    return (e * e).sum(axis=-1)
