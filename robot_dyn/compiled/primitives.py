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


# Nothing is allocated, so arrays need no reference counts, which would take longer than a step; Numba's own name.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "_nrt": False}


def plain(*functions: Callable[..., Any]) -> None:
    """Let machine code call these functions, as they stand."""
    for function in functions:
        register_jitable(**_OPTIONS)(function)


def machine_code(function: Callable[..., Any]) -> Any:
    """A function for Numba to compile, as it stands; it must not allocate."""
    return njit(**_OPTIONS)(function)
