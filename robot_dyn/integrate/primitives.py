"""Primitives of steps and loops: the few operations that exist twice, as NumPy and as loops of machine code.

    x = y + h Σ_j w_j K_j

Here they are NumPy, in any arithmetic (elimination in floats); `compiled.primitives` has their machine code. All code
above them exists once. A state is (m, W), entry by run: one run, or W of them in lock step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from robot_dyn.foundations.arithmetic import Array, midpoint

MOST_ITERATIONS = 100  # the iteration must gain a binary digit in two rounds, to end in float64
PATIENCE = 2  # rounds: where q' = v and v' = −k q, increments shrink only every second one
NOISE = 1e3  # roundings of the largest entry that an increment may keep, as where forces cancel
GOING, SETTLED, LOST = 1, 0, 2  # an iteration: not yet ended; at rounding; overflowed
F = TypeVar("F", bound=Callable[..., Any])


def inlined(function: F) -> F:
    """Mark a plain function for machine code, which then inserts it at each call: for parts of a loop."""
    function.__dict__["inlined"] = True
    return function


def evaluate(function: Any, t: Any, y: Array, p: Array, run_parameters: Array, out: Array) -> None:
    """Write a function of (t, y, p, run_parameters) into `out`; in machine code the function is an address.

    Args:
        function: Such as the rate y' = f(t, y).
        t: Time.
        y: State, (m, W).
        p: Numbers that all runs share, (P,).
        run_parameters: Numbers of each run, (O, W).
        out: Output, (r, W).
    """
    function(t, y, p, run_parameters, out)


def combination(x: Array, y: Array, h: Any, weights: Array, K: Array, count: int) -> None:
    """X = y + h Σ_{j < count} w_j K_j, of the first m rows of each K_j, (s, r, W)."""
    total, m = None, len(y)
    for j in range(count):
        if weights[j] != 0:
            term = K[j, :m] * weights[j]
            total = term if total is None else total + term
    x[...] = y if total is None else y + total * h


def copy(to: Array, x: Array) -> None:
    """Write the numbers of an array into another of its shape."""
    to[...] = x


def sizes(x: Array, out: Array) -> None:
    """Σ |x_e| of each run."""
    out[...] = 0
    for row in x:  # in the order of machine code
        out += np.abs(row)


def below(x: Array, limit: Any) -> bool:
    """Whether all entries of x (W,) are less than a limit; nan is not."""
    return bool((x < limit).all())


def enclose(low: Array, high: Array, x: Array, least: float, most: float) -> bool:
    """Extend low and high (W,), neither nan, to x (W,); return whether any x is below `least` or above `most`.

    A nan in x changes nothing.
    """
    np.fmin(low, x, low)
    np.fmax(high, x, high)
    return bool(((x < least) | (x > most)).any())


def subtract(x: Array, y: Array) -> None:
    """X − y in place of x, of one shape."""
    x[...] = x - y


def norm(x: Array, y: Array, after: Array, rtol: float, atol: float) -> float:
    """√ of the mean of (x / (atol + rtol max(|y|, |y⁺|)))², of arrays (m, 1); inf if x is not finite."""
    ratio = x / (atol + rtol * np.maximum(np.abs(y), np.abs(after)))
    total = float(np.add.accumulate(ratio.ravel() ** 2)[-1]) / ratio.size  # in the order of machine code
    return float(np.sqrt(total)) if total < np.inf else np.inf


def between(y: Array, F: Array, theta: float, out: Array) -> None:
    """Y(t + θ h) = y + θ (F₀ + (1 − θ) (F₁ + θ (F₂ + …))), of the polynomial F (d, m, W) of a step."""
    x = np.zeros_like(y)
    for i in range(len(F) - 1, -1, -1):
        x = (x + F[i]) * (theta if i % 2 == 0 else 1 - theta)
    out[...] = y + x


def settle(Z: Array, new: Array, y: Array, least: Array, stale: Array, state: Array, epsilon: Any) -> int:
    """Take the next iterate of a fixed-point iteration for the runs that are going; return how many continue.

    It ends when no increments shrink any more and all are of the size of rounding. Entries count separately, so that
    one in a large unit does not end the iteration of the others. In balls midpoints count.

    Args:
        Z: Iterate, (s, m, W); becomes the next one.
        new: Next iterate.
        y: The state that it is a change of, (m, W); taken to be of size 1 at least in some entry.
        least: Smallest increment so far, (m, W).
        stale: Rounds since one shrank, (W,).
        state: GOING, SETTLED or LOST, (W,).
        epsilon: Unit of rounding.
    """
    going = state == GOING
    new = _exact(new)
    change, run_parameters, size = (np.abs(_middle(x)).max(axis=0) for x in (new - Z, new, y[None]))
    Z[..., going] = new[..., going]
    shrinks = ((change < least) & (change > epsilon * run_parameters)).any(axis=0)
    least[:, going] = np.minimum(least, change)[:, going]
    stale[going] = np.where(shrinks, 0, stale + 1)[going]
    # an increment of some power of epsilon between 1/2 and 1 is rounding of Φ: far below any error that matters
    slack = NOISE * epsilon * np.maximum(1.0, size.max(axis=0))
    rounding = (change <= slack + epsilon ** (2 / 3) * (size + run_parameters)).all(axis=0)
    largest = change.max(axis=0)
    ended = (largest == 0) | ((stale >= PATIENCE) & rounding)
    state[going] = np.where(~np.isfinite(largest), LOST, np.where(ended, SETTLED, GOING))[going]
    return int((state == GOING).sum())


def _exact(x: Array) -> Array:
    """Balls without their radius; floats as they are."""
    if x.dtype != object:
        return x
    return np.vectorize(lambda ball: ball.mid(), otypes=[object])(x)


def _middle(x: Array) -> Array:
    return x if x.dtype != object else midpoint(x)


def factor(A: Array, J: Array, scale: Any, rows: Array, lost: Array) -> None:
    """L U = P (1 − scale J) for W matrices, by elimination with the largest entry of each column as pivot.

    [Golub and Van Loan, Matrix Computations, 4th ed., 2013, alg. 3.4.1]

    Args:
        A: Output: the factors by column, A[j, i] is row i of column j, (m, m, W).
        J: Matrices by column, and what may follow them, (m, m, W) or more.
        scale: Number.
        rows: Output: the row that each one is exchanged with, (m, W).
        lost: 1 where a pivot is 0, (W,); else 0.
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
        none = A[k, k] == 0
        lost[none], A[k, k, none] = 1, 1
        A[k, k + 1 :] /= A[k, k]
        A[k + 1 :, k + 1 :] -= A[k, k + 1 :] * A[k + 1 :, k, None]


def solve(A: Array, rows: Array, x: Array) -> None:
    """A⁻¹ x in place of x, (m, W), by the factors of `factor`."""
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
