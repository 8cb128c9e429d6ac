"""The primitives of steps as machine code; what they compute is told in `integrate.primitives`.

They are functions of the subset, which Python can call as well, over a few operations on whole arrays that are written
in instructions of LLVM. Sums run in the order of NumPy's, entry by entry. Each looks at the sizes of its arguments
itself; within, nothing is checked.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from llvmlite import ir

from robot_dyn.compiled.llvm.vectors import Vectors
from robot_dyn.compiled.loops import arrays, vectors
from robot_dyn.compiled.loops.kinds import F64, FLOAT, INT
from robot_dyn.compiled.loops.numbers import converted, scalar, truth
from robot_dyn.compiled.loops.values import ArrayValue, Scalar, StaticValue, Value
from robot_dyn.integrate import primitives
from robot_dyn.integrate.primitives import GOING, LOST, NOISE, PATIENCE, SETTLED

if TYPE_CHECKING:
    from robot_dyn.arithmetic import Array
    from robot_dyn.compiled.loops.function import Function

_POINTER = F64.as_pointer()
_NUMBERS = 32, 8, 4, 1  # of a sum at a time, in registers
NOTHING = StaticValue(None)


def emits(handler: Callable[..., Value]) -> Callable[..., Value]:
    """Mark a function that writes instructions: (f, node, arguments) → value."""
    handler.emits = True  # type: ignore[attr-defined]
    return handler


# Operations that are written in instructions, each with what it does in Python


def require(holds: bool, what: str) -> None:
    """Fail unless a condition holds."""
    if not holds:
        raise ValueError(what)


def part(x: Array, first: int, count: int) -> Array:
    """So many entries of a contiguous array, in one axis."""
    return x.reshape(-1)[first : first + count]


def weighted_sum(x: Array, y: Array, h: float, weights: Array, K: Array, count: int) -> None:
    """X = y + h Σ w_j K_j over the weights that are not 0, one at least; sums in registers."""
    for e in range(y.size):
        total = -0.0  # which leaves the first term as it is
        for j in range(count):
            if weights[j] != 0.0:
                total += part(K[j], e, 1)[0] * weights[j]
        part(x, e, 1)[0] = part(y, e, 1)[0] + total * h


def subtract_multiple(x: Array, y: Array, s: float) -> None:
    """X − s y in place of x."""
    x -= y * s


def subtract_product(x: Array, y: Array, z: Array) -> None:
    """X − y z in place of x, entry by entry."""
    x -= y * z


def divide(x: Array, s: Any) -> None:
    """X / s in place of x, of a number or entry by entry."""
    x /= s


def add_sizes(x: Array, y: Array) -> None:
    """X + |y| in place of x."""
    x += np.abs(y)


def keep_least(x: Array, y: Array) -> None:
    """The lesser of x and y in place of x, entry by entry; of nan the other."""
    np.fmin(x, y, x)


def keep_largest(x: Array, y: Array) -> None:
    """The larger of x and y in place of x, entry by entry; of nan the other."""
    np.fmax(x, y, x)


@emits
def _evaluate(f: Function, node: ast.AST, function: Scalar, t: Scalar, *given: ArrayValue) -> Value:
    """A call of an address."""
    for x in given:
        if not isinstance(x, ArrayValue) or x.kind.of != FLOAT or not x.kind.contiguous:
            raise f.refused(node, "an evaluation at what is no contiguous array of floats", "copy it into one that is")
    if not f.silent:
        shape = ir.FunctionType(ir.VoidType(), [F64, *[_POINTER] * len(given)])
        pointer = f.builder.inttoptr(converted(f, function, INT, node).ir, shape.as_pointer())
        f.builder.call(pointer, [converted(f, t, FLOAT, node).ir, *(x.data for x in given)])
    return NOTHING


@emits
def _require(f: Function, node: ast.AST, holds: Scalar, what: StaticValue) -> Value:
    f.check(truth(f, holds), node, what.value)
    return NOTHING


@emits
def _part(f: Function, node: ast.AST, x: ArrayValue, first: Scalar, count: Scalar) -> Value:
    return arrays.part(f, x, first, count, node)


@emits
def _weighted_sum(
    f: Function, node: ast.AST, x: ArrayValue, y: ArrayValue, h: Value, weights: ArrayValue, K: ArrayValue, count: Any
) -> Value:
    if not all(each.kind.contiguous for each in (x, y, weights, K)):
        raise f.refused(node, "a combination of arrays that are not contiguous", "copy them first")
    if f.silent:
        return NOTHING
    b, h = f.builder, converted(f, scalar(f, h, node), FLOAT, node)
    stage = K.strides(b)[0].ir
    for width, e in vectors.chunks(f, arrays.size(f, y), _NUMBERS):
        kind = vectors.kind(width, FLOAT)
        entry, look = b.block, b.append_basic_block()
        add, following, behind = (b.append_basic_block() for _ in range(3))
        b.branch(look)
        b.position_at_end(look)
        j, total = b.phi(INT.llvm), b.phi(kind)
        j.add_incoming(ir.Constant(INT.llvm, 0), entry)
        total.add_incoming(ir.Constant(kind, -0.0 if width == 1 else [-0.0] * width), entry)
        weight = b.load(b.gep(weights.data, [j], inbounds=True))
        b.cbranch(b.fcmp_unordered("!=", weight, ir.Constant(F64, 0.0)), add, following)
        b.position_at_end(add)
        term = vectors.loaded(b, K.data, b.add(b.mul(j, stage), e), width, FLOAT)
        more = b.fadd(total, b.fmul(term, vectors.spread(b, weight, width, FLOAT)))
        b.branch(following)
        b.position_at_end(following)
        so_far = b.phi(kind)
        so_far.add_incoming(total, look)
        so_far.add_incoming(more, add)
        after = b.add(j, ir.Constant(INT.llvm, 1))
        j.add_incoming(after, following)
        total.add_incoming(so_far, following)
        b.cbranch(b.icmp_signed("<", after, count.ir), look, behind)
        b.position_at_end(behind)
        moved = b.fmul(so_far, vectors.spread(b, h.ir, width, FLOAT))
        vectors.stored(b, b.fadd(vectors.loaded(b, y.data, e, width, FLOAT), moved), x.data, e, width, FLOAT)
    return NOTHING


def _in_place(rule: Callable[..., Any]) -> Callable[..., Value]:
    """X ← rule(x, …), entry by entry."""

    @emits
    def handler(f: Function, node: ast.AST, x: ArrayValue, *others: Value) -> Value:
        vectors.each(f, node, x, [x, *others], rule)
        return NOTHING

    return handler


@emits
def _copy(f: Function, node: ast.AST, to: ArrayValue, x: ArrayValue) -> Value:
    """Of arrays of one shape, whatever their strides."""
    if to.kind.ndim != x.kind.ndim or to.kind.frozen or to.kind.of != x.kind.of:
        raise f.refused(node, "a copy of an array into one of other axes or numbers", "take arrays that are alike")
    for i in range(to.kind.ndim):
        same = f.builder.icmp_signed("==", to.shape[i].ir, x.shape[i].ir)
        f.check(same, node, "a copy of an array into one of another shape")
    if to.kind.contiguous and x.kind.contiguous:
        vectors.each(f, node, to, [x], lambda b, x: x)
    else:
        _copied(f, to, x, [])
    return NOTHING


def _copied(f: Function, to: ArrayValue, x: ArrayValue, indices: list[Scalar]) -> None:
    if len(indices) == to.kind.ndim:
        arrays.store(f, to, indices, arrays.load(f, x, indices))
        return
    with f.loop(to.shape[len(indices)]) as index:
        _copied(f, to, x, [*indices, index])


@emits
def _multiply(f: Function, node: ast.AST, x: ArrayValue, y: Value, out: ArrayValue) -> Value:
    vectors.each(f, node, out, [x, y], lambda b, x, y: b.fmul(x, y))
    return NOTHING


def _with_size(b: Any, x: Any, y: Any) -> Any:
    return b.fadd(x, Vectors(b, F64, getattr(y.type, "count", 1)).intrinsic("fabs", y))


def _kept(order: str) -> Callable[..., Any]:
    """Y where it is in that order to x, or x is nan; else x."""

    def rule(b: Any, x: Any, y: Any) -> Any:
        return b.select(b.or_(b.fcmp_ordered(order, y, x), b.fcmp_unordered("uno", x, x)), y, x)

    return rule


# The primitives


def combination(x: Array, y: Array, h: Any, weights: Array, K: Array, count: int) -> None:
    """See `integrate.primitives`, as of the others."""
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
    """As of NumPy."""
    require(x.shape[1] == len(out), "a sum for other runs")
    for b in range(len(out)):
        out[b] = 0.0
    for e in range(len(x)):
        add_sizes(out, x[e])


def enclose(low: Array, high: Array, first: int, x: Array) -> None:
    """As of NumPy."""
    start = first * x.shape[1]
    require(low.shape[1] == x.shape[1] and high.shape[1] == x.shape[1], "bounds of other runs")
    keep_least(part(low, start, x.size), part(x, 0, x.size))
    keep_largest(part(high, start, x.size), part(x, 0, x.size))


def norm(x: Array, y: Array, after: Array, rtol: float, atol: float) -> float:
    """As of NumPy."""
    require(x.shape[1] == 1, "a norm of several runs")
    require(len(x) == len(y) and len(x) == len(after), "arrays of a norm have other sizes")
    total = 0.0
    for e in range(len(x)):
        before, behind = abs(y[e, 0]), abs(after[e, 0])
        larger = before if before > behind or before != before else behind
        ratio = x[e, 0] / (atol + rtol * larger)
        total += ratio * ratio
    total = total / len(x)
    return np.sqrt(total) if total < np.inf else np.inf


def between(y: Array, F: Array, theta: float, out: Array) -> None:
    """As of NumPy."""
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
    """As of NumPy."""
    m, W = y.shape
    require(
        len(Z) == len(new) and Z.shape[1] == m and new.shape[1] == m and len(least) == m and Z.shape[2] == W
        and new.shape[2] == W and least.shape[1] == W and len(stale) == W and len(state) == W,
        "arrays of an iteration have other sizes",
    )  # fmt: skip
    going, some = 0, epsilon ** (2 / 3)
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
            rounding &= change <= NOISE * epsilon * slack + some * (abs(y[e, b]) + own)
            largest = larger(largest, change)
        stale[b] = 0 if shrinks else stale[b] + 1
        if not largest < np.inf:
            state[b] = LOST
        elif largest == 0.0 or (stale[b] >= PATIENCE and rounding):
            state[b] = SETTLED
        else:
            going += 1
    return going


def larger(x: float, y: float) -> float:
    """The larger one, nan if one is nan, as NumPy's."""
    return y if y > x or y != y else x


def factor(A: Array, J: Array, scale: float, rows: Array, lost: Array) -> None:
    """As of NumPy, along columns or across the runs."""
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
    """Divide column k by its pivot, and take its multiples off the columns behind it."""
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
    """As of NumPy."""
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
    """x_i ← x_i − A_ik x_k for rows i from `low` to before `high`."""
    if x.shape[1] == 1:
        subtract_multiple(part(x, low, high - low), part(column, low, high - low), x[k, 0])
        return
    for i in range(low, high):
        subtract_product(x[i], column[i], x[k])


larger.inlined = True  # type: ignore[attr-defined]

INSTEAD: Mapping[Any, Callable[..., Any]] = MappingProxyType(
    {
        primitives.evaluate: _evaluate, primitives.combination: combination, primitives.copy: _copy,
        primitives.sizes: sizes, primitives.enclose: enclose,
        primitives.subtract: _in_place(lambda b, x, y: b.fsub(x, y)),
        primitives.norm: norm, primitives.between: between, primitives.settle: settle, primitives.factor: factor,
        primitives.solve: solve, np.multiply: _multiply, require: _require, part: _part, weighted_sum: _weighted_sum,
        subtract_multiple: _in_place(lambda b, x, y, s: b.fsub(x, b.fmul(y, s))),
        subtract_product: _in_place(lambda b, x, y, z: b.fsub(x, b.fmul(y, z))),
        divide: _in_place(lambda b, x, s: b.fdiv(x, s)), add_sizes: _in_place(_with_size),
        keep_least: _in_place(_kept("<")), keep_largest: _in_place(_kept(">")),
        **{each: each for each in (larger, eliminate, take_off)},
    }
)  # fmt: skip
