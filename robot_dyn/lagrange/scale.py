"""Comparison scales: divisors for the difference of two values of a quantity, and tolerances for the ratio.

    |x − y| ≤ tolerance · (Σ of the absolute values of the terms summed in x)

The terms are those of `Magnitudes`; an entry without terms uses the largest in its row and column. Solutions of
M a = τ may differ by max(tolerance, 8 n u κ) times the terms of τ, where κ is the condition number of M scaled to a
unit diagonal.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from robot_dyn.foundations.arithmetic import apply


def scaled(error: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return |error| / scale, with 0 / 0 = 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(error) / scale
    return np.where(np.asarray(error) == 0, 0.0, ratio)


def floored(scale: np.ndarray) -> np.ndarray:
    """Return the scale of each entry, (n,), (m, n) or a number.

    An entry without terms uses the largest scale in its row and column, because it contains only rounding errors of
    its neighbours.
    """
    if scale.ndim != 2:
        return np.where(scale == 0, np.max(scale, initial=0.0), scale)
    near = np.maximum(scale.max(axis=0)[None, :], scale.max(axis=1)[:, None])
    near = np.where(near == 0, scale.max(), near)
    return np.where(scale == 0, near, scale)


def diagonal_scale(M: np.ndarray) -> np.ndarray:
    """Return √(M_ii M_jj), an upper bound of |M_ij| for positive definite matrices (..., n, n)."""
    d = np.sqrt(np.abs(np.diagonal(M, axis1=-2, axis2=-1)))
    return d[..., :, None] * d[..., None, :]


def joint_units(M: np.ndarray) -> np.ndarray:
    """Return D = √M_ii, (..., n), of matrices (..., n, n); it makes large and small joints comparable."""
    return np.sqrt(np.maximum(np.diagonal(M, axis1=-2, axis2=-1), 1e-300))


def mass_norm(M: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return ‖x‖_M = √(xᵀ M x) of x (..., n)."""
    return np.sqrt(np.maximum((x * apply(M, x)).sum(axis=-1), 0.0))


def unit_diagonal_conditions(M: np.ndarray) -> np.ndarray:
    """Return κ of each matrix in (..., n, n), scaled to a unit diagonal."""
    d = joint_units(M)
    return np.linalg.cond(M / (d[..., :, None] * d[..., None, :]))


def unit_diagonal_condition(M: np.ndarray) -> float:
    """Return the largest κ of `unit_diagonal_conditions`."""
    return float(np.max(unit_diagonal_conditions(M)))


def solved_tolerance(least: float, M: np.ndarray, dtype: str = "float64") -> float:
    """Return the tolerance of solutions of M a = τ, max(least, 8 n u κ), κ the largest of the matrices (..., n, n)."""
    return max(least, 8 * M.shape[-1] * float(np.finfo(dtype).eps) / 2 * unit_diagonal_condition(M))


def solved_norm(M: np.ndarray, torques: Iterable[np.ndarray]) -> np.ndarray:
    """Return Σ ‖M⁻¹ τ_k‖_M over torques τ_k, (..., n) each."""
    return np.sum([mass_norm(M, np.linalg.solve(M, torque[..., None])[..., 0]) for torque in torques], axis=0)


def acceleration_norm(M: np.ndarray, torques: Iterable[np.ndarray], terms: np.ndarray) -> float:
    """Return the scale of ‖a − a'‖_M at one state: the larger of `solved_norm` of the torques and ‖D⁻¹ terms‖.

    Cancellation in sums such as C v and N is visible only in their terms, (n,).
    """
    return max(float(solved_norm(M, torques)), float(np.linalg.norm(terms / joint_units(M))))


def acceleration_entries(d: np.ndarray, terms: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Return scales (S, n) of accelerations a (S, n) at S states, from D and the terms of τ, both (S, n)."""
    return np.max([np.linalg.norm(terms / d, axis=-1), np.linalg.norm(a * d, axis=-1)]) / d


def derivative_entries(d: np.ndarray, terms: np.ndarray, derivatives: np.ndarray) -> np.ndarray:
    """Return scales of ∂a/∂q, ∂a/∂v and ∂a/∂τ, (S, 3, n, n): per column the larger of its terms and entries."""
    whole = np.linalg.norm(terms / d, axis=-1)
    sides = np.stack([np.broadcast_to(whole[:, None], d.shape)] * 2 + [1 / d], axis=1)  # by q, by v, by τ
    columns = np.abs(derivatives * d[:, None, :, None]).max(axis=-2, keepdims=True)
    return np.maximum(sides[:, :, None, :], columns) / d[:, None, :, None]
