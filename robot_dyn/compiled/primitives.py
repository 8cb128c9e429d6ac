"""The primitives of steps and loops as machine code; what they compute is told in `integrate.primitives`.

A function of the state equation is an address there: (t, y, p, own, out), of pointers to float64.
"""

from __future__ import annotations

from collections.abc import Callable
from inspect import getclosurevars, isfunction
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit
from numba.core import cgutils, types
from numba.extending import intrinsic, overload, register_jitable

from robot_dyn.integrate import primitives
from robot_dyn.integrate.primitives import GOING, LOST, NOISE, PATIENCE, SETTLED, copy

_DOUBLE, _I32, _I64 = ir.DoubleType(), ir.IntType(32), ir.IntType(64)
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


def _typed_sum(typingctx: Any, x: Any, y: Any, h: Any, weights: Any, K: Any, count: Any) -> Any:
    """As of `combination`, for a single run: by vectors of entries, whose sums stay in registers."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        (to, start, w, k), h, count = _arrays(context, builder, signature, args, (0, 1, 3, 4)), args[2], args[5]
        rows, stage = builder.extract_value(start.shape, 0), builder.extract_value(k.shape, 1)

        def chunk(width: int) -> Callable[[Any], None]:
            kind = _DOUBLE if width == 1 else ir.VectorType(_DOUBLE, width)

            def many(x: Any) -> Any:
                if width == 1:
                    return x
                one = builder.insert_element(ir.Constant(kind, ir.Undefined), x, ir.Constant(_I32, 0))
                return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(_I32, width), [0] * width))

            def at(pointer: Any, index: Any) -> Any:
                return builder.bitcast(builder.gep(pointer, [index]), kind.as_pointer())

            def made(e: Any) -> None:
                total = cgutils.alloca_once_value(builder, ir.Constant(kind, None))
                with cgutils.for_range(builder, count) as loop:
                    weight = many(builder.load(builder.gep(w.data, [loop.index])))
                    term = builder.load(at(k.data, builder.add(builder.mul(loop.index, stage), e)), align=8)
                    builder.store(builder.fadd(builder.load(total), builder.fmul(weight, term)), total)
                x = builder.fadd(builder.load(at(start.data, e), align=8), builder.fmul(builder.load(total), many(h)))
                builder.store(x, at(to.data, e), align=8)

            return made

        first = ir.Constant(_I64, 0)
        for width in (8, 4, 1):
            each = ir.Constant(_I64, width)
            last = builder.mul(builder.sdiv(rows, each), each)
            with cgutils.for_range_slice(builder, first, last, each) as (e, _):
                chunk(width)(e)
            first = last
        return context.get_dummy_value()

    return types.void(x, y, types.float64, weights, K, types.int64), code


def _arrays(context: Any, builder: Any, signature: Any, args: Any, which: tuple[int, ...]) -> list[Any]:
    return [context.make_array(signature.args[i])(context, builder, args[i]) for i in which]


_sum: Any = intrinsic(_typed_sum)


@overload(primitives.evaluate, strict=False)
def _evaluate(function: Any, t: Any, y: Any, p: Any, own: Any, out: Any) -> Any:
    return lambda function, t, y, p, own, out: _call(function, t, y, p, own, out)


@overload(primitives.combination, strict=False)
def _combination(x: Any, y: Any, h: Any, weights: Any, K: Any, count: Any) -> Any:
    def loops(x, y, h, weights, K, count):
        if y.shape[1] == 1:
            _sum(x, y, h, weights, K, count)
            return
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


@overload(primitives.enclose, strict=False)
def _enclose(low: Any, high: Any, first: Any, x: Any) -> Any:
    def loops(low, high, first, x):
        at, of = first * x.shape[1], _part(x, 0, x.size)
        least, largest = _part(low, at, x.size), _part(high, at, x.size)
        for i in range(x.size):
            least[i] = of[i] if of[i] < least[i] else least[i]
            largest[i] = of[i] if of[i] > largest[i] else largest[i]

    return loops


@overload(primitives.subtract, strict=False)
def _subtract(x: Any, y: Any) -> Any:
    def loops(x, y):
        to, less = _part(x, 0, x.size), _part(y, 0, x.size)
        for i in range(x.size):
            to[i] -= less[i]

    return loops


@overload(primitives.norm, strict=False)
def _norm(x: Any, y: Any, after: Any, rtol: Any, atol: Any) -> Any:
    def loops(x, y, after, rtol, atol):
        total = 0.0
        for e in range(x.shape[0]):
            ratio = x[e, 0] / (atol + rtol * max(abs(y[e, 0]), abs(after[e, 0])))
            total += ratio * ratio
        total /= x.shape[0]
        return np.sqrt(total) if total < np.inf else np.inf

    return loops


@overload(primitives.between, strict=False)
def _between(y: Any, F: Any, theta: Any, out: Any) -> Any:
    def loops(y, F, theta, out):
        for e in range(y.shape[0]):
            for b in range(y.shape[1]):
                x = 0.0
                for i in range(F.shape[0] - 1, -1, -1):
                    x = (x + F[i, e, b]) * (theta if i % 2 == 0 else 1.0 - theta)
                out[e, b] = y[e, b] + x

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


_registered: set[Callable[..., Any]] = set()


def reached(function: Callable[..., Any]) -> list[Callable[..., Any]]:
    """A function and all that it calls, but for the primitives: those it names in its module, or where it was made."""
    found: dict[Callable[..., Any], None] = {}

    def look(each: Callable[..., Any]) -> None:
        if each in found or each.__module__ == primitives.__name__:
            return
        found[each] = None
        scope = {**each.__globals__, **getclosurevars(each).nonlocals}
        for name in each.__code__.co_names + each.__code__.co_freevars:
            if isfunction(scope.get(name)):
                look(scope[name])

    look(function)
    return list(found)


def machine_code(function: Callable[..., Any]) -> Any:
    """A function for Numba to compile, as it stands, with all that it calls; it must not allocate."""
    for each in reached(function)[1:]:
        if each not in _registered:
            _registered.add(each)
            register_jitable(**_OPTIONS)(each)
    return njit(**_OPTIONS)(function)
