"""Levenberg–Marquardt within bounds: q with lower ≤ q ≤ upper and least ½‖e(q)‖², from many starts in lock step.

    d = Jᵀ (J Jᵀ + λ 1)⁻¹ e,   λ = μ ‖e‖²,   q⁺ = min(max(q + d, lower), upper)

J has the columns of the joints that are free: not of those at a bound which the descent direction Jᵀ e pushes against.
μ shrinks after steps that do what J predicts, and grows after those that do not (Nielsen). Where e tends to 0, λ does
as its square, so that convergence is quadratic.

[Yamashita, Fukushima, On the rate of convergence of the Levenberg–Marquardt method, 2001; Kanzow, Yamashita, Fukushima,
Levenberg–Marquardt methods with strong local convergence properties for solving nonlinear equations with convex
constraints, 2004; Nielsen, Damping parameter in Marquardt's method, 1999]
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

_START = 1e-2  # μ
_LEAST, _MOST = 1e-12, 1e16  # μ; beyond, no step descends
_ROUNDING = 1e-13  # of the trace of J Jᵀ: where rows of J depend on each other the solve stays regular

Residual = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


class Descent(NamedTuple):
    """Where B starts ended.

    Attributes:
        q: Shape (B, n).
        e: Residuals there, (B, m).
        J: −∂e/∂q there, (B, m, n).
        iterations: Evaluations of e, (B,).
    """

    q: np.ndarray
    e: np.ndarray
    J: np.ndarray
    iterations: np.ndarray


def descend(
    residual: Residual, q: np.ndarray, lower: np.ndarray, upper: np.ndarray, *, tolerance: float, most: int
) -> Descent:
    """Descend from each row of q until ‖e‖ ≤ tolerance, or no step descends, or after `most` evaluations.

    Args:
        residual: Of positions (b, n) and their rows, (b,), of the B starts: e (b, m) and J = −∂e/∂q, (b, m, n).
        q: Starts within the bounds, (B, n).
        lower: Bounds, (n,), −inf where there is none.
        upper: Likewise, inf.
        tolerance: Of ‖e‖.
        most: Evaluations of each start.
    """
    q, rows = q.copy(), np.arange(len(q))
    e, J = residual(q, rows)
    mu, factor, iterations = np.full(len(q), _START), np.full(len(q), 2.0), np.ones(len(q), int)
    for _ in range(1, most):
        rows = rows[(_square(e[rows]) > tolerance**2) & (mu[rows] < _MOST)]
        if not len(rows):
            break
        here, old, slope = q[rows], e[rows], J[rows]
        there = np.clip(here + _step(here, old, slope, lower, upper, mu[rows]), lower, upper)
        new, slope_there = residual(there, rows)
        predicted = _square(old) - _square(old - (slope @ (there - here)[..., None])[..., 0])
        gain = (_square(old) - _square(new)) / np.where(predicted > 0, predicted, np.inf)
        good = gain > 0
        q[rows[good]], e[rows[good]], J[rows[good]] = there[good], new[good], slope_there[good]
        change = np.where(good, np.maximum(0.1, 1 - (2 * gain - 1) ** 3), factor[rows])
        mu[rows] = np.maximum(mu[rows] * change, _LEAST)
        factor[rows] = np.where(good, 2.0, 2 * factor[rows])
        iterations[rows] += 1
    return Descent(q, e, J, iterations)


def held(q: np.ndarray, e: np.ndarray, J: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Joints at a bound which the descent direction Jᵀ e pushes against, (..., n)."""
    pull = np.swapaxes(J, -1, -2) @ e[..., None]
    return ((q <= lower) & (pull[..., 0] < 0)) | ((q >= upper) & (pull[..., 0] > 0))


def _step(
    q: np.ndarray, e: np.ndarray, J: np.ndarray, lower: np.ndarray, upper: np.ndarray, mu: np.ndarray
) -> np.ndarray:
    J = np.where(held(q, e, J, lower, upper)[:, None, :], 0, J)
    A = J @ np.swapaxes(J, 1, 2)
    damping = mu * _square(e) + _ROUNDING * np.trace(A, axis1=1, axis2=2) + np.finfo(float).tiny
    A = A + damping[:, None, None] * np.eye(A.shape[-1])
    return (np.swapaxes(J, 1, 2) @ np.linalg.solve(A, e[..., None]))[..., 0]


def _square(e: np.ndarray) -> np.ndarray:
    return (e * e).sum(axis=-1)
