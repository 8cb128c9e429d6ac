"""The primitives of steps as machine code; `integrate.primitives` documents their results.

They are functions of the subset, which Python can call too, built from operations on whole arrays. Sums have the same
order as in NumPy, entry by entry. Each function checks the sizes of its arguments; its code is not checked further.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from robot_dyn.codegen.array_operations import (
    OPERATIONS,
    copying,
    divide,
    enclosure,
    evaluation,
    limitation,
    part,
    require,
    subtract_multiple,
    subtract_product,
    subtraction,
    sum_sizes,
    weighted_sum,
)  # fmt: skip
from robot_dyn.integrate import primitives
from robot_dyn.integrate.primitives import GOING, LOST, NOISE, PATIENCE, SETTLED

if TYPE_CHECKING:
    from robot_dyn.foundations.arithmetic import Array


def combination(x: Array, y: Array, h: float, weights: Array, K: Array, count: int) -> None:
    """Same as `integrate.primitives.combination`."""
    require(
        count <= len(weights) and count <= len(K) and len(x) == len(y) and len(y) <= K.shape[1]
        and x.shape[1] == y.shape[1] and y.shape[1] == K.shape[2], "arrays of a combination have other sizes",
    )  # fmt: skip
    terms = 0
    for j in range(count):
        if weights[j] != 0.0:
            terms += 1
    if terms == 0:
        primitives.copy(x, y)
        return
    weighted_sum(x, y, h, weights, K, count)


def sizes(x: Array, out: Array) -> None:
    """Same as `integrate.primitives.sizes`."""
    require(x.shape[1] == len(out), "a sum for other runs")
    sum_sizes(x, out)


def norm(x: Array, y: Array, after: Array, rtol: float, atol: float) -> float:
    """Same as `integrate.primitives.norm`, for one run."""
    require(x.shape[1] == 1, "a norm of several runs")
    require(len(x) == len(y) and len(x) == len(after), "arrays of a norm have other sizes")
    total = 0.0
    for e in range(len(x)):
        before, now = abs(y[e, 0]), abs(after[e, 0])
        larger = before if before > now or before != before else now
        ratio = x[e, 0] / (atol + rtol * larger)
        total += ratio * ratio
    total = total / len(x)
    return np.sqrt(total) if total < np.inf else np.inf


def between(y: Array, F: Array, theta: float, out: Array) -> None:
    """Same as `integrate.primitives.between`."""
    require(
        F.shape[1] == len(y) and len(out) == len(y) and y.shape[1] == F.shape[2] and y.shape[1] == out.shape[1],
        "arrays of a polynomial have other sizes",
    )
    for e in range(y.shape[0]):
        for b in range(y.shape[1]):
            x = 0.0
            for i in range(F.shape[0] - 1, -1, -1):
                x = (x + F[i, e, b]) * (theta if i % 2 == 0 else 1.0 - theta)
            out[e, b] = y[e, b] + x


def settle(Z: Array, new: Array, y: Array, least: Array, stale: Array, state: Array, epsilon: float) -> int:
    """Same as `integrate.primitives.settle`."""
    m, W = y.shape
    require(
        len(Z) == len(new) and Z.shape[1] == m and new.shape[1] == m and len(least) == m and Z.shape[2] == W
        and new.shape[2] == W and least.shape[1] == W and len(stale) == W and len(state) == W,
        "arrays of an iteration have other sizes",
    )  # fmt: skip
    active, small = 0, epsilon ** (2 / 3)
    for b in range(W):
        if state[b] != GOING:
            continue
        slack = 1.0
        for e in range(m):
            slack = larger(slack, abs(y[e, b]))
        shrinks, rounding, largest = False, True, 0.0
        for e in range(m):
            change, own = 0.0, 0.0
            for i in range(len(Z)):
                change, own = larger(change, abs(new[i, e, b] - Z[i, e, b])), larger(own, abs(new[i, e, b]))
                Z[i, e, b] = new[i, e, b]
            shrinks |= (change < least[e, b]) & (change > epsilon * own)
            if change < least[e, b] or change != change:
                least[e, b] = change
            rounding &= change <= NOISE * epsilon * slack + small * (abs(y[e, b]) + own)
            largest = larger(largest, change)
        stale[b] = 0 if shrinks else stale[b] + 1
        if not largest < np.inf:
            state[b] = LOST
        elif largest == 0.0 or (stale[b] >= PATIENCE and rounding):
            state[b] = SETTLED
        else:
            active += 1
    return active


def larger(x: float, y: float) -> float:
    """Return the larger number; nan if one is nan, as in NumPy."""
    return y if y > x or y != y else x


def factor(A: Array, J: Array, scale: float, rows: Array, lost: Array) -> None:
    """Same as `integrate.primitives.factor`, along columns or across the runs."""
    m, W = rows.shape
    require(
        len(A) == m and A.shape[1] == m and A.shape[2] == W and len(J) >= m and J.shape[1] == m and J.shape[2] == W
        and len(lost) == W, "arrays of an elimination have other sizes",
    )  # fmt: skip
    np.multiply(part(J, 0, m * m * W), -scale, part(A, 0, m * m * W))
    for j in range(m):
        for b in range(W):
            A[j, j, b] += 1.0
    for b in range(W):
        lost[b] = 0
    for k in range(m):
        for b in range(W):
            best, at = abs(A[k, k, b]), k
            for i in range(k + 1, m):
                x = abs(A[k, i, b])
                if x > best or (x != x and best == best):
                    best, at = x, i
            rows[k, b] = at
            if at != k:
                for j in range(m):
                    A[j, k, b], A[j, at, b] = A[j, at, b], A[j, k, b]
            if A[k, k, b] == 0.0:
                lost[b], A[k, k, b] = 1, 1.0
        eliminate(A, k)


def eliminate(A: Array, k: int) -> None:
    """Divide column k by its pivot, and subtract its multiples from the columns after it."""
    m, W = A.shape[1], A.shape[2]
    rest = m - k - 1
    if W == 1:  # a vector along the column
        column = part(A[k], k + 1, rest)
        divide(column, A[k, k, 0])
        for j in range(k + 1, m):
            subtract_multiple(part(A[j], k + 1, rest), column, A[j, k, 0])
        return
    for i in range(k + 1, m):
        divide(A[k, i], A[k, k])
    for j in range(k + 1, m):
        for i in range(k + 1, m):
            subtract_product(A[j, i], A[k, i], A[j, k])


def solve(A: Array, rows: Array, x: Array) -> None:
    """Same as `integrate.primitives.solve`."""
    m, W = rows.shape
    require(
        len(A) == m and A.shape[1] == m and A.shape[2] == W and len(x) == m and x.shape[1] == W,
        "arrays of a linear system have other sizes",
    )
    for k in range(m):
        for b in range(W):
            at = rows[k, b]
            require(at >= k and at < m, "a row to exchange is out of range")
            x[k, b], x[at, b] = x[at, b], x[k, b]
    for k in range(m):
        take_off(x, A[k], k, k + 1, m)
    for k in range(m - 1, -1, -1):
        for b in range(W):
            x[k, b] /= A[k, k, b]
        take_off(x, A[k], k, 0, k)


def take_off(x: Array, column: Array, k: int, low: int, high: int) -> None:
    """Set x_i ← x_i − A_ik x_k for rows i from `low` to before `high`."""
    if x.shape[1] == 1:
        subtract_multiple(part(x, low, high - low), part(column, low, high - low), x[k, 0])
        return
    for i in range(low, high):
        subtract_product(x[i], column[i], x[k])


larger.inlined = True  # pyright: ignore

INSTEAD: Mapping[Callable[..., object], Callable[..., object]] = MappingProxyType(
    {
        **OPERATIONS, primitives.evaluate: evaluation, primitives.copy: copying, primitives.subtract: subtraction,
        primitives.combination: combination, primitives.sizes: sizes, primitives.norm: norm,
        primitives.enclose: enclosure, primitives.below: limitation,
        primitives.between: between, primitives.settle: settle, primitives.factor: factor, primitives.solve: solve,
        **{function: function for function in (larger, eliminate, take_off)},
    }
)  # fmt: skip
