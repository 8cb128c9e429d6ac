"""Extremes of piecewise polynomials, at the zeros of a derivative and at the ends of pieces; no grid is used.

A polynomial is monotonic between neighbouring zeros of its derivative, so bisection finds its zeros, degree by degree,
from the linear derivative up. The Bernstein coefficients of a polynomial enclose its values, so only a few pieces of a
long motion must be examined.
"""

from __future__ import annotations

from math import comb
from typing import NamedTuple

import numpy as np

from robot_dyn.control.reference import PiecewisePolynomial

_HALVINGS = 60  # more than the bits of a double
_ROUNDING = 1e-12  # relative to the largest coefficient


class Extremes(NamedTuple):
    """Smallest and largest value of each joint, and their times in [s], all (n,)."""

    least: np.ndarray
    greatest: np.ndarray
    least_at_s: np.ndarray
    greatest_at_s: np.ndarray

    @property
    def largest(self) -> np.ndarray:
        """The largest absolute value, (n,)."""
        return np.maximum(-self.least, self.greatest)


def extreme_values(motion: PiecewisePolynomial, order: int = 0) -> Extremes:
    """Compute the extremes of q (order 0), or of a derivative, between the first and the last break.

    Args:
        motion: A motion of k pieces.
        order: 1 for the velocity, 2 for the acceleration, 3 for the jerk.
    """
    h = np.diff(motion.breaks)
    c = np.moveaxis(motion.coefficients, 1, -1) * h[:, None, None] ** np.arange(motion.coefficients.shape[1])
    for _ in range(order):
        c = _derivative(c)
    c = c / h[:, None, None] ** order
    candidates = _may_be_extreme(c)
    c, h, starts = c[candidates], h[candidates], motion.breaks[:-1][candidates]
    s = _critical(c)
    values = _value(c, s)  # (k, n, zeros)
    t = starts[:, None, None] + s * h[:, None, None]
    values, t = (np.moveaxis(x, 1, 0).reshape(motion.n, -1) for x in (values, t))
    row, low, high = np.arange(motion.n), values.argmin(axis=1), values.argmax(axis=1)
    return Extremes(values[row, low], values[row, high], t[row, low], t[row, high])


def _may_be_extreme(c: np.ndarray) -> np.ndarray:
    """Return True for pieces that may contain an extreme, (k,): not enclosed by values at the starts of pieces."""
    d = c.shape[-1] - 1
    to_bernstein = np.array([[comb(i, j) / comb(d, j) for i in range(d + 1)] for j in range(d + 1)])
    b, starts = c @ to_bernstein, c[..., 0]
    size = np.abs(b).max(axis=(0, 2)) * _ROUNDING
    high, low = starts.max(axis=0) - size, starts.min(axis=0) + size
    return ((b.max(axis=-1) >= high) | (b.min(axis=-1) <= low)).any(axis=-1)


def _derivative(c: np.ndarray) -> np.ndarray:
    """Return the coefficients of p′ from the coefficients of p, (..., d + 1); 0 for a constant."""
    return c[..., 1:] * np.arange(1, c.shape[-1]) if c.shape[-1] > 1 else 0 * c


def _value(c: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Evaluate p(s) for c, (..., d + 1), and s, (..., m)."""
    p = np.zeros_like(s)
    for j in reversed(range(c.shape[-1])):
        p = p * s + c[..., j, None]
    return p


def _critical(c: np.ndarray) -> np.ndarray:
    """Return the ends of [0, 1] and the zeros of p′ between them, increasing, (..., m), possibly repeated."""
    ends = np.broadcast_to([0.0, 1.0], (*c.shape[:-1], 2))
    if c.shape[-1] <= 2:
        return ends
    p = _derivative(c)
    walls = _critical(p)  # p is monotonic between them
    low, high = walls[..., :-1].copy(), walls[..., 1:].copy()
    rises = _value(p, low) < 0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        left = (_value(p, middle) < 0) == rises  # the zero, if there is one, is to the right of the middle
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    return np.concatenate([ends[..., :1], low, ends[..., 1:]], axis=-1)
