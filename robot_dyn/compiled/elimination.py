"""Elimination as machine code: the primitives `factor` and `solve` of `integrate.primitives`, by loops.

Of one run, along columns; of W runs in lock step, across the runs, each with pivots of its own.
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload, register_jitable

from robot_dyn.compiled.primitives import _OPTIONS, _part
from robot_dyn.integrate import primitives

_inside = register_jitable(**_OPTIONS)


@overload(primitives.factor, strict=False)
def _factor(A: Any, J: Any, scale: Any, rows: Any, lost: Any) -> Any:
    def loops(A, J, scale, rows, lost):
        m, W = rows.shape
        for j in range(m):
            to, of = _part(A[j], 0, m * W), _part(J[j], 0, m * W)
            for e in range(m * W):
                to[e] = of[e] * -scale
            for b in range(W):
                A[j, j, b] += 1.0
        lost[:] = 0
        for k in range(m):
            for b in range(W):
                best, at = abs(A[k, k, b]), k
                for i in range(k + 1, m):
                    if abs(A[k, i, b]) > best:
                        best, at = abs(A[k, i, b]), i
                rows[k, b] = at
                if at != k:
                    for j in range(m):
                        A[j, k, b], A[j, at, b] = A[j, at, b], A[j, k, b]
                if A[k, k, b] == 0.0:
                    lost[b], A[k, k, b] = 1, 1.0
            _eliminate(A, k)

    return loops


@_inside
def _eliminate(A, k):  # pyright: ignore
    """Divide column k by its pivot, and take its multiples off the columns behind it."""
    m, W = A.shape[1], A.shape[2]
    if W == 1:  # a vector along the column
        pivot, column = A[k, k, 0], _part(A[k], 0, m)
        for i in range(k + 1, m):
            column[i] /= pivot
        for j in range(k + 1, m):
            other = _part(A[j], 0, m)
            x = other[k]
            for i in range(k + 1, m):
                other[i] -= column[i] * x
        return
    for i in range(k + 1, m):
        for b in range(W):
            A[k, i, b] /= A[k, k, b]
    for j in range(k + 1, m):
        for i in range(k + 1, m):
            for b in range(W):
                A[j, i, b] -= A[k, i, b] * A[j, k, b]


@overload(primitives.solve, strict=False)
def _solve(A: Any, rows: Any, x: Any) -> Any:
    def loops(A, rows, x):
        m, W = rows.shape
        for k in range(m):
            for b in range(W):
                at = rows[k, b]
                x[k, b], x[at, b] = x[at, b], x[k, b]
        for k in range(m):
            _take_off(x, A[k], k, k + 1, m)
        for k in range(m - 1, -1, -1):
            for b in range(W):
                x[k, b] /= A[k, k, b]
            _take_off(x, A[k], k, 0, k)

    return loops


@_inside
def _take_off(x, column, k, low, high):  # pyright: ignore
    """x_i ← x_i − A_ik x_k for rows i from `low` to before `high`."""
    if x.shape[1] == 1:
        y, a = _part(x, 0, len(x)), _part(column, 0, len(x))
        x_k = y[k]
        for i in range(low, high):
            y[i] -= a[i] * x_k
        return
    for i in range(low, high):
        for b in range(x.shape[1]):
            x[i, b] -= column[i, b] * x[k, b]
