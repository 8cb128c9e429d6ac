"""The primitives of steps and loops as machine code; what they compute is told in `integrate.primitives`.

A function of the state equation is an address there: (t, y, p, own, out), of pointers to float64.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit
from numba.core import types
from numba.extending import intrinsic, overload, register_jitable

from robot_dyn.integrate import primitives
from robot_dyn.integrate.primitives import GOING, LOST, NOISE, PATIENCE, SETTLED, copy

_DOUBLE, _I64 = ir.DoubleType(), ir.IntType(64)
_BLOCK = 512  # numbers of a sum at a time


def _typed_call(typingctx: Any, address: Any, t: Any, y: Any, p: Any, own: Any, out: Any) -> Any:
    """The function at an address, of a time and of the first numbers of arrays."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        arrays = [
            context.make_array(kind)(context, builder, x) for kind, x in zip(signature.args[2:], args[2:], strict=True)
        ]
        pointer = _DOUBLE.as_pointer()
        shape = ir.FunctionType(ir.VoidType(), [_DOUBLE, *[pointer] * len(arrays)])
        function = builder.inttoptr(args[0], shape.as_pointer())
        builder.call(function, [args[1], *(builder.bitcast(x.data, pointer) for x in arrays)])
        return context.get_dummy_value()

    return types.void(types.int64, types.float64, y, p, own, out), code


_call: Any = intrinsic(_typed_call)


def _typed_part(typingctx: Any, array: Any, first: Any, count: Any) -> Any:
    """So many numbers of a C-contiguous array; to compile `reshape` and slices takes as long as a step."""
    kind = types.Array(array.dtype, 1, "C")

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        of, made = (
            context.make_array(signature.args[0])(context, builder, args[0]),
            context.make_array(kind)(context, builder),
        )
        shape, strides = (
            builder.insert_value(ir.Constant(ir.ArrayType(_I64, 1), ir.Undefined), x, 0) for x in (args[2], of.itemsize)
        )
        made.data, made.shape, made.strides = builder.gep(of.data, [args[1]]), shape, strides
        made.itemsize, made.nitems = of.itemsize, args[2]
        made.meminfo, made.parent = (ir.Constant(x.type, None) for x in (made.meminfo, made.parent))
        return made._getvalue()

    return kind(array, types.int64, types.int64), code


_part: Any = intrinsic(_typed_part)


# Nothing is allocated, so arrays need no reference counts, which would take longer than a step; Numba's own name.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "_nrt": False}
_inside = register_jitable(**_OPTIONS)


@overload(primitives.evaluate, strict=False)
def _evaluate(function: Any, t: Any, y: Any, p: Any, own: Any, out: Any) -> Any:
    return lambda function, t, y, p, own, out: _call(function, t, y, p, own, out)


@overload(primitives.combination, strict=False)
def _combination(x: Any, y: Any, h: Any, weights: Any, K: Any, count: Any) -> Any:
    def loops(x, y, h, weights, K, count):
        terms, last = 0, -1
        for j in range(count):
            if weights[j] != 0.0:
                terms, last = terms + 1, j
        if terms == 0:
            copy(x, y)
            return
        for low in range(0, y.size, _BLOCK):  # so that sums stay in the nearest cache
            n, done, w_last = min(_BLOCK, y.size - low), 0, weights[last]
            to, start, k_last = _part(x, low, n), _part(y, low, n), _part(K[last], low, n)
            if terms == 1:
                for e in range(n):
                    to[e] = start[e] + (w_last * k_last[e]) * h
                continue
            for j in range(last):
                w = weights[j]
                if w != 0.0:
                    k = _part(K[j], low, n)
                    if done == 0:
                        for e in range(n):
                            to[e] = w * k[e]
                    else:
                        for e in range(n):
                            to[e] += w * k[e]
                    done += 1
            for e in range(n):
                to[e] = start[e] + (to[e] + w_last * k_last[e]) * h

    return loops


@overload(primitives.copy, strict=False)
def _copy(to: Any, x: Any) -> Any:
    if to.ndim == 1:

        def loops(to, x):
            for i in range(to.shape[0]):
                to[i] = x[i]

    elif to.layout == x.layout == "C":

        def loops(to, x):
            all_of_it, numbers = _part(to, 0, to.size), _part(x, 0, x.size)
            for i in range(to.size):
                all_of_it[i] = numbers[i]

    else:

        def loops(to, x):
            for i in range(to.shape[0]):
                for j in range(to.shape[1]):
                    to[i, j] = x[i, j]

    return loops


@overload(primitives.sizes, strict=False)
def _sizes(x: Any, out: Any) -> Any:
    def loops(x, out):
        if out.size == 1:
            total = 0.0
            for e in range(x.shape[0]):
                total += abs(x[e, 0])
            out[0] = total
            return
        out[:] = 0.0
        for e in range(x.shape[0]):
            for b in range(x.shape[1]):
                out[b] += abs(x[e, b])

    return loops


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


@overload(primitives.settle, strict=False)
def _settle(Z: Any, new: Any, y: Any, least: Any, stale: Any, state: Any, epsilon: Any) -> Any:
    def loops(Z, new, y, least, stale, state, epsilon):
        going = 0
        for b in range(y.shape[1]):
            if state[b] != GOING:
                continue
            slack = 1.0
            for e in range(y.shape[0]):
                slack = max(slack, abs(y[e, b]))
            shrinks, rounding, largest = False, True, 0.0
            for e in range(y.shape[0]):
                change = own = 0.0
                for i in range(Z.shape[0]):
                    step = abs(new[i, e, b] - Z[i, e, b])
                    change = step if not step <= change else change
                    own = max(own, abs(new[i, e, b]))
                    Z[i, e, b] = new[i, e, b]
                shrinks |= (change < least[e, b]) & (change > epsilon * own)
                least[e, b] = min(change, least[e, b])
                bound = NOISE * epsilon * slack + epsilon ** (2 / 3) * (abs(y[e, b]) + own)
                rounding &= change <= bound
                largest = change if not change <= largest else largest
            stale[b] = 0 if shrinks else stale[b] + 1
            if not largest < np.inf:
                state[b] = LOST
            elif largest == 0.0 or (stale[b] >= PATIENCE and rounding):
                state[b] = SETTLED
            else:
                going += 1
        return going

    return loops


def plain(*functions: Callable[..., Any]) -> None:
    """Let machine code call these functions, as they stand."""
    for function in functions:
        _inside(function)


def machine_code(function: Callable[..., Any]) -> Any:
    """A function for Numba to compile, as it stands; it must not allocate."""
    return njit(**_OPTIONS)(function)
