"""Operations on whole arrays, written in instructions of LLVM, each with its equivalent in Python.

The primitives of machine code consist of them.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, final

import numpy as np
from llvmlite import ir

from robot_dyn.codegen.llvm.vectors import Vectors
from robot_dyn.codegen.loops import arrays, vectors
from robot_dyn.codegen.loops.kinds import BOOL, F64, FLOAT, I8, INT
from robot_dyn.codegen.loops.numbers import converted, real, scalar, truth
from robot_dyn.codegen.loops.values import ArrayValue, Scalar, StaticValue, Value

if TYPE_CHECKING:
    from robot_dyn.codegen.loops.function import Function
    from robot_dyn.foundations.arithmetic import Array

_POINTER = F64.as_pointer()
_NUMBERS = 32, 8, 4, 1  # of a sum at a time, in registers
NOTHING = StaticValue(None)


def emits(handler: Callable[..., Value]) -> Callable[..., Value]:
    """Mark a function that writes instructions: (f, node, arguments) → value."""
    handler.emits = True  # pyright: ignore
    return handler


def require(holds: bool, what: str) -> None:
    """Fail unless a condition holds."""
    if not holds:
        raise ValueError(what)


def part(x: Array, first: int, count: int) -> Array:
    """A one-dimensional view of `count` entries of a contiguous array."""
    return x.reshape(-1)[first : first + count]


def weighted_sum(x: Array, y: Array, h: float, weights: Array, K: Array, count: int) -> None:
    """X = y + h Σ w_j K_j over the weights other than 0, at least one; sums in registers."""
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


def sum_sizes(x: Array, out: Array) -> None:
    """Σ |x_e| over the rows of x; sums in registers."""
    for b in range(len(out)):
        total = 0.0
        for e in range(len(x)):
            total += np.abs(x[e, b])
        out[b] = total


@emits
def evaluation(f: Function, node: ast.AST, function: Scalar, t: Scalar, *given: ArrayValue) -> Value:
    """A call of an address."""
    for x in given:
        if not isinstance(x, ArrayValue) or x.kind.of != FLOAT or not x.kind.contiguous:
            raise f.refused(
                node, "an evaluation at something other than contiguous arrays of floats", "copy it into one that is"
            )
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
    b, h = f.builder, real(f, h, node)
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
def copying(f: Function, node: ast.AST, to: ArrayValue, x: ArrayValue) -> Value:
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
def multiplication(f: Function, node: ast.AST, x: ArrayValue, y: Value, out: ArrayValue) -> Value:
    """X y, of an array and another or a number."""
    vectors.each(f, node, out, [x, y], lambda b, x, y: b.fmul(x, y))
    return NOTHING


@emits
def _sum_sizes(f: Function, node: ast.AST, x: ArrayValue, out: ArrayValue) -> Value:
    if not (x.kind.contiguous and out.kind.contiguous):
        raise f.refused(node, "a sum over arrays that are not contiguous", "copy them first")
    if f.silent:
        return NOTHING
    b, (rows, W) = f.builder, x.shape
    for width, e in vectors.chunks(f, W, vectors.WIDTHS):
        of = Vectors(b, F64, width)
        with b.goto_entry_block():
            total = b.alloca(of.type)
        b.store(of.constant(0.0), total)
        with vectors.steps(b, vectors.ZERO, rows.ir, 1) as k:
            given = vectors.loaded(b, x.data, b.add(b.mul(k, W.ir), e), width, FLOAT)
            b.store(b.fadd(b.load(total), of.intrinsic("fabs", given)), total)
        vectors.stored(b, b.load(total), out.data, e, width, FLOAT)
    return NOTHING


@emits
def limitation(f: Function, node: ast.AST, x: ArrayValue, limit: Value) -> Value:
    """Whether all entries of an array are less than a limit."""
    vectors.check(f, node, x, [])
    if f.silent:
        return Scalar(BOOL, None)
    b, of = f.builder, x.kind.of
    most, less = converted(f, scalar(f, limit, node), of, node), b.fcmp_ordered if of == FLOAT else b.icmp_signed
    found = _Found(b)
    for width, e in vectors.chunks(f, arrays.size(f, x), vectors.WIDTHS):
        below = less("<", vectors.loaded(b, x.data, e, width, of), vectors.spread(b, most.ir, width, of))
        found.add(b.not_(below), width)
    return Scalar(BOOL, b.not_(found.value))


@final
class _Found:
    """Whether one of the masks of a loop, of at most 8 entries, held for an entry."""

    def __init__(self, b: Any) -> None:
        self._builder = b
        with b.goto_entry_block():
            self._bits = b.alloca(I8)
        b.store(ir.Constant(I8, 0), self._bits)

    def add(self, mask: Any, width: int) -> None:
        """Another mask."""
        b, bits = self._builder, self._builder.bitcast(mask, ir.IntType(width))
        b.store(b.or_(b.load(self._bits), bits if width == 8 else b.zext(bits, I8)), self._bits)

    @property
    def value(self) -> Any:
        """The result after the loop."""
        return self._builder.icmp_unsigned("!=", self._builder.load(self._bits), ir.Constant(I8, 0))


@emits
def enclosure(
    f: Function, node: ast.AST, low: ArrayValue, high: ArrayValue, x: ArrayValue, least: Value, most: Value
) -> Value:
    """Low and high enclose x, and whether any entry of x is outside of two numbers; x is read once."""
    for bound in (low, high):
        vectors.check(f, node, bound, [x])
    if f.silent:
        return Scalar(BOOL, None)
    b, (least, most) = f.builder, (real(f, bound, node) for bound in (least, most))
    found = _Found(b)
    for width, e in vectors.chunks(f, arrays.size(f, x), vectors.WIDTHS):
        given, outside = vectors.loaded(b, x.data, e, width, FLOAT), []
        for bound, order, limit in ((low, "<", least), (high, ">", most)):
            known = vectors.loaded(b, bound.data, e, width, FLOAT)
            farther = b.select(b.fcmp_ordered(order, given, known), given, known)
            vectors.stored(b, farther, bound.data, e, width, FLOAT)
            outside.append(b.fcmp_ordered(order, given, vectors.spread(b, limit.ir, width, FLOAT)))
        found.add(b.or_(*outside), width)
    return Scalar(BOOL, found.value)


subtraction = _in_place(lambda b, x, y: b.fsub(x, y))
OPERATIONS: Mapping[Any, Callable[..., Value]] = MappingProxyType(
    {
        require: _require, part: _part, weighted_sum: _weighted_sum, np.multiply: multiplication,
        subtract_multiple: _in_place(lambda b, x, y, s: b.fsub(x, b.fmul(y, s))),
        subtract_product: _in_place(lambda b, x, y, z: b.fsub(x, b.fmul(y, z))),
        divide: _in_place(lambda b, x, s: b.fdiv(x, s)), sum_sizes: _sum_sizes,
    }
)  # fmt: skip
