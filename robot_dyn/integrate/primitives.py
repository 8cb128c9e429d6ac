"""Primitives of steps and loops: the few operations that exist twice, in NumPy and as loops of machine code.

    x = y + h Σ_j w_j K_j

This file has the NumPy versions, in any arithmetic (elimination in floats only); `codegen.primitives` has the machine
code. All other code of steps and loops exists once. A state is (m, W): entries of one run, or of W runs in lock step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from robot_dyn.foundations.arithmetic import Array, Scalar, midpoint

MAX_ITERATIONS = 100  # enough for float64 if every two rounds gain a binary digit
PATIENCE = 2  # rounds: with q' = v and v' = −k q, increments shrink only in every second one
NOISE = 1e3  # rounding errors of the largest entry that may remain in an increment, for example where forces cancel
GOING, SETTLED, LOST = 1, 0, 2  # state of an iteration: not ended; at rounding; overflowed
F = TypeVar("F", bound=Callable[..., Any])


def inlined(function: F) -> F:
    """Mark a plain function for machine code, which then inserts it at each call: for parts of a loop."""
    function.__dict__["inlined"] = True
    return function


def evaluate(
    function: Callable[..., object] | int | None, t: Scalar, y: Array, p: Array, run_parameters: Array, out: Array
) -> None:
    """Write a function of (t, y, p, run_parameters) into `out`; in machine code the function is an address.

    Args:
        function: The function, for example the rate y' = f(t, y).
        t: Time.
        y: State, (m, W).
        p: Parameters that all runs share, (P,).
        run_parameters: Parameters of each run, (O, W).
        out: Output, (r, W).
    """
    assert callable(function), "addresses are for machine code"
    function(t, y, p, run_parameters, out)


def combination(x: Array, y: Array, h: Scalar, weights: Array, K: Array, count: int) -> None:
    """Write y + h Σ_{j < count} w_j K_j into x, from the first m rows of each K_j, (s, r, W)."""
    total, m = None, len(y)
    for j in range(count):
        if weights[j] != 0:
            term = K[j, :m] * weights[j]
            total = term if total is None else total + term
    x[...] = y if total is None else y + total * h


def copy(to: Array, x: Array) -> None:
    """Copy the entries of x into an array of the same shape."""
    to[...] = x


def sizes(x: Array, out: Array) -> None:
    """Write Σ_e |x_e| of each run into `out`."""
    out[...] = 0
    for row in x:  # in the order of machine code
        out += np.abs(row)


def below(x: Array, limit: Scalar) -> bool:
    """Return True if all entries of x (W,) are less than a limit; nan is not."""
    return bool((x < limit).all())


def enclose(low: Array, high: Array, x: Array, least: float, most: float) -> bool:
    """Extend the ranges low and high (W,) to x (W,); return True if any x is below `least` or above `most`.

    Entries of x that are nan are ignored; low and high must not be nan.
    """
    np.fmin(low, x, low)
    np.fmax(high, x, high)
    return bool(((x < least) | (x > most)).any())


def subtract(x: Array, y: Array) -> None:
    """Subtract y from x in place; both have the same shape."""
    x[...] = x - y


def norm(x: Array, y: Array, after: Array, rtol: float, atol: float) -> float:
    """Return the root mean square of x / (atol + rtol max(|y|, |y⁺|)), for arrays (m, 1); inf if x is not finite."""
    ratio = x / (atol + rtol * np.maximum(np.abs(y), np.abs(after)))
    total = float(np.add.accumulate(ratio.ravel() ** 2)[-1]) / ratio.size  # in the order of machine code
    return float(np.sqrt(total)) if total < np.inf else np.inf


def between(y: Array, F: Array, theta: float, out: Array) -> None:
    """Write y(t + θ h) = y + θ (F₀ + (1 − θ) (F₁ + θ (F₂ + …))) into out, for the polynomial F (d, m, W) of a step."""
    x = np.zeros_like(y)
    for i in range(len(F) - 1, -1, -1):
        x = (x + F[i]) * (theta if i % 2 == 0 else 1 - theta)
    out[...] = y + x


def settle(Z: Array, new: Array, y: Array, least: Array, stale: Array, state: Array, epsilon: float) -> int:
    """Take the next iterate of a fixed-point iteration for the runs that continue; return their number afterwards.

    The iteration of a run ends when its increments no longer shrink and all are as small as rounding. Entries are
    judged separately, so that an entry in a large unit does not end the iteration of the others. In balls, midpoints
    are judged.

    Args:
        Z: Iterate, (s, m, W); replaced by the next one.
        new: Next iterate, (s, m, W).
        y: State to which the iterate is added, (m, W); its largest entry counts as at least 1.
        least: Smallest increment so far, (m, W).
        stale: Rounds since an increment shrank, (W,).
        state: GOING, SETTLED or LOST, (W,).
        epsilon: Unit roundoff.
    """
    going = state == GOING
    new = _exact(new)
    change, iterate, size = (np.abs(_middle(x)).max(axis=0) for x in (new - Z, new, y[None]))
    Z[..., going] = new[..., going]
    shrinks = ((change < least) & (change > epsilon * iterate)).any(axis=0)
    least[:, going] = np.minimum(least, change)[:, going]
    stale[going] = np.where(shrinks, 0, stale + 1)[going]
    # an increment of a power of epsilon between 1/2 and 1 is rounding of Φ: far below any relevant error
    slack = NOISE * epsilon * np.maximum(1.0, size.max(axis=0))
    is_rounding = (change <= slack + epsilon ** (2 / 3) * (size + iterate)).all(axis=0)
    largest = change.max(axis=0)
    ended = (largest == 0) | ((stale >= PATIENCE) & is_rounding)
    state[going] = np.where(~np.isfinite(largest), LOST, np.where(ended, SETTLED, GOING))[going]
    return int((state == GOING).sum())


def _exact(x: Array) -> Array:
    """Return balls without their radius, or floats unchanged."""
    if x.dtype != object:
        return x
    return np.vectorize(lambda ball: ball.mid(), otypes=[object])(x)


def _middle(x: Array) -> Array:
    return x if x.dtype != object else midpoint(x)


def factor(A: Array, J: Array, scale: Scalar, rows: Array, lost: Array) -> None:
    """Factorise L U = P (1 − scale J) for W matrices, by Gaussian elimination with partial pivoting.

    [Golub and Van Loan, Matrix Computations, 4th ed., 2013, alg. 3.4.1]

    Args:
        A: Output: the factors by column, A[j, i] is row i of column j, (m, m, W).
        J: Matrices by column, (m, m, W); further columns are ignored.
        scale: Factor of J.
        rows: Output: the row with which each row is exchanged, (m, W).
        lost: Output: 1 for runs with a zero pivot, otherwise 0, (W,).
    """
    m, runs = len(A), np.arange(A.shape[2])
    np.multiply(J[:m], -scale, A)
    A[np.arange(m), np.arange(m)] += 1
    lost[...] = 0
    for k in range(m):
        rows[k] = k + np.abs(A[k, k:]).argmax(axis=0)
        top = A[:, k].copy()
        A[:, k] = A[:, rows[k], runs]
        A[:, rows[k], runs] = top
        is_singular = A[k, k] == 0
        lost[is_singular], A[k, k, is_singular] = 1, 1
        A[k, k + 1 :] /= A[k, k]
        A[k + 1 :, k + 1 :] -= A[k, k + 1 :] * A[k + 1 :, k, None]


def solve(A: Array, rows: Array, x: Array) -> None:
    """Replace x (m, W) by the solution of the linear systems, from the factors and exchanges of `factor`."""
    m, runs = len(A), np.arange(A.shape[2])
    for k in range(m):
        top = x[k].copy()
        x[k] = x[rows[k], runs]
        x[rows[k], runs] = top
    for k in range(m):
        x[k + 1 :] -= A[k, k + 1 :] * x[k]
    for k in range(m - 1, -1, -1):
        x[k] /= A[k, k]
        x[:k] -= A[k, :k] * x[k]
