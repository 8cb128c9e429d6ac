"""Polynomials on a step in Bernstein form, whose coefficients enclose them: coefficients of one sign exclude a root.

    p(θ) = Σ_j b_j C(d, j) θʲ (1 − θ)^(d−j),   min b ≤ p(θ) ≤ max b   for 0 ≤ θ ≤ 1

[Farouki, The Bernstein polynomial basis: a centennial retrospective, Computer Aided Geometric Design, 2012]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array

NONE = 2.0  # returned without a root
_NARROW = 1e-13  # fraction of a step: an interval this narrow is not divided further
_MAX_DEPTH = 64  # in floats, further halving has no effect


def work_array(degree: int) -> np.ndarray:
    """Return the work array of `first_below`."""
    return np.zeros((_MAX_DEPTH, degree + 3))


def coefficients(start: float, F: Array, e: int, b: Array) -> None:
    """Write coefficients b (d + 1,) of entry e of `primitives.between`: start + θ (F₀ + (1 − θ) (F₁ + θ (F₂ + …)))."""
    d = len(F)
    b[0] = 0.0
    for i in range(d - 1, -1, -1):
        k = d - 1 - i  # degree before the product
        for j in range(k + 1):
            b[j] += F[i, e, 0]
        if i % 2 == 0:  # times θ
            for j in range(k + 1, 0, -1):
                b[j] = b[j - 1] * j / (k + 1)
            b[0] = 0.0
        else:
            b[k + 1] = 0.0
            for j in range(k + 1):
                b[j] *= (k + 1 - j) / (k + 1)
    for j in range(d + 1):
        b[j] += start


def rate_coefficients(F: Array, e: int, h: float, b: Array) -> None:
    """Write the coefficients of the time derivative of entry e, on a step of length h: the first d of b (d + 1,)."""
    d = len(F)
    coefficients(0.0, F, e, b)
    for j in range(d):
        b[j] = d * (b[j + 1] - b[j]) / h


def value(b: Array, theta: float) -> float:
    """Return the value of a polynomial at θ."""
    total, power, d = 0.0, 1.0, len(b) - 1
    for j in range(d + 1):  # b_j C(d, j) θʲ (1 − θ)^(d−j)
        total += b[j] * power * (1 - theta) ** (d - j)
        power *= theta * (d - j) / (j + 1)
    return total


def first_below(b: Array, slack: float, stack: Array) -> float:
    """Return the first θ at which a polynomial falls below −slack, within rounding; NONE if it never does.

    Args:
        b: Coefficients of the polynomial, (d + 1,).
        slack: Rounding error of the coefficients.
        stack: See `work_array`.
    """
    d, depth = len(b) - 1, 1
    stack[0, 0], stack[0, 1] = 0.0, 1.0
    for j in range(d + 1):
        stack[0, 2 + j] = b[j]
    while depth > 0:
        piece = stack[depth - 1]
        low, high, least = piece[0], piece[1], np.inf
        for j in range(d + 1):
            least = min(least, piece[2 + j])
        if least >= -slack:
            depth -= 1
            continue
        if piece[2] < -slack or high - low <= _NARROW or depth == _MAX_DEPTH:
            return low
        middle, left = (low + high) / 2, stack[depth]  # the right half stays below, the left one comes first
        left[0], left[1] = low, middle
        for k in range(d + 1):  # de Casteljau: the first coefficients of all levels are the left half
            left[2 + k] = piece[2]
            for j in range(d - k):
                piece[2 + j] = (piece[2 + j] + piece[3 + j]) / 2
        # the last coefficients of all levels remain in place: the right half
        piece[0] = middle
        depth += 1
    return NONE
