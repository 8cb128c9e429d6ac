"""Operations on whole arrays, written as LLVM instructions, each with its Python equivalent.

The primitives of machine code are built from them.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, final

import numpy as np
from llvmlite import ir

from robot_dyn.codegen.llvm.vectors import Vectors
from robot_dyn.codegen.loops import arrays, vectors
from robot_dyn.codegen.loops.kinds import BOOL, F64, FLOAT, I8, INT
from robot_dyn.codegen.loops.numbers import converted, real, scalar, truth
from robot_dyn.codegen.loops.values import UNWRITTEN, ArrayValue, Builder, Scalar, StaticValue, Value

if TYPE_CHECKING:
    from robot_dyn.codegen.loops.function import Function
    from robot_dyn.foundations.arithmetic import Array

_POINTER = F64.as_pointer()
_NUMBERS = 32, 8, 4, 1  # sums computed at a time, in registers
NEGLIGIBLE = StaticValue(None)


def emits(handler: Callable[..., Value]) -> Callable[..., Value]:
    """Mark a function that emits instructions: (f, node, arguments) → value."""
    handler.emits = True  # pyright: ignore
    return handler


def require(holds: bool, message: str) -> None:
    """Raise ValueError unless a condition holds."""
    if not holds:
        raise ValueError(message)


def part(x: Array, first: int, count: int) -> Array:
    """Return a one-dimensional view of `count` entries of a contiguous array."""
    return x.reshape(-1)[first : first + count]


def weighted_sum(x: Array, y: Array, h: float, weights: Array, K: Array, count: int) -> None:
    """Set x = y + h Σ w_j K_j over the nonzero weights, at least one; sums in registers."""
    for e in range(y.size):
        total = -0.0  # adding −0.0 does not change the first term
        for j in range(count):
            if weights[j] != 0.0:
                total += part(K[j], e, 1)[0] * weights[j]
        part(x, e, 1)[0] = part(y, e, 1)[0] + total * h


def subtract_multiple(x: Array, y: Array, s: float) -> None:
    """Set x ← x − s y."""
    x -= y * s


def subtract_product(x: Array, y: Array, z: Array) -> None:
    """Set x ← x − y z, entry by entry."""
    x -= y * z


def divide(x: Array, s: float | Array) -> None:
    """Set x ← x / s, for a number or entry by entry."""
    x /= s


def sum_sizes(x: Array, out: Array) -> None:
    """Set out to Σ |x_e| over the rows of x; sums in registers."""
    for b in range(len(out)):
        total = 0.0
        for e in range(len(x)):
            total += np.abs(x[e, b])
        out[b] = total


@emits
def evaluation(f: Function, node: ast.AST, function: Scalar, t: Scalar, *arrays_: ArrayValue) -> Value:
    """Call the function at an address."""
    for argument in arrays_:
        if not isinstance(argument, ArrayValue) or argument.kind.number != FLOAT or not argument.kind.contiguous:
            raise f.refused(node, "an evaluation of arrays that are not contiguous arrays of floats", "copy them first")
    if not f.silent:
        shape = ir.FunctionType(ir.VoidType(), [F64, *[_POINTER] * len(arrays_)])
        pointer = f.builder.inttoptr(converted(f, function, INT, node).ir, shape.as_pointer())
        f.builder.call(pointer, [converted(f, t, FLOAT, node).ir, *(argument.data for argument in arrays_)])
    return NEGLIGIBLE


@emits
def _require(f: Function, node: ast.AST, holds: Scalar, message: StaticValue) -> Value:
    f.check(truth(f, holds), node, str(message.value))
    return NEGLIGIBLE


@emits
def _part(f: Function, node: ast.AST, x: ArrayValue, first: Scalar, count: Scalar) -> Value:
    return arrays.part(f, x, first, count, node)


@emits
def _weighted_sum(
    f: Function,
    node: ast.AST,
    x: ArrayValue,
    y: ArrayValue,
    h: Value,
    weights: ArrayValue,
    K: ArrayValue,
    count: Scalar,
) -> Value:
    if not all(array.kind.contiguous for array in (x, y, weights, K)):
        raise f.refused(node, "a combination of arrays that are not contiguous", "copy them first")
    if f.silent:
        return NEGLIGIBLE
    b, h = f.builder, real(f, h, node)
    stage = K.strides(b)[0].ir
    for width, e in vectors.chunks(f, arrays.size(f, y), _NUMBERS):
        kind = vectors.kind(width, FLOAT)
        entry, head = b.block, b.append_basic_block()
        add, following, done = (b.append_basic_block() for _ in range(3))
        b.branch(head)
        b.position_at_end(head)
        j, total = b.phi(INT.llvm), b.phi(kind)
        j.add_incoming(ir.Constant(INT.llvm, 0), entry)
        total.add_incoming(ir.Constant(kind, -0.0 if width == 1 else [-0.0] * width), entry)
        weight = b.load(b.gep(weights.data, [j], inbounds=True))
        b.cbranch(b.fcmp_unordered("!=", weight, ir.Constant(F64, 0.0)), add, following)
        b.position_at_end(add)
        term = vectors.loaded(b, K.data, b.add(b.mul(j, stage), e), width, FLOAT)
        increased = b.fadd(total, b.fmul(term, vectors.spread(b, weight, width, FLOAT)))
        b.branch(following)
        b.position_at_end(following)
        so_far = b.phi(kind)
        so_far.add_incoming(total, head)
        so_far.add_incoming(increased, add)
        after = b.add(j, ir.Constant(INT.llvm, 1))
        j.add_incoming(after, following)
        total.add_incoming(so_far, following)
        b.cbranch(b.icmp_signed("<", after, count.ir), head, done)
        b.position_at_end(done)
        moved = b.fmul(so_far, vectors.spread(b, h.ir, width, FLOAT))
        vectors.stored(b, b.fadd(vectors.loaded(b, y.data, e, width, FLOAT), moved), x.data, e, width, FLOAT)
    return NEGLIGIBLE


def _in_place(rule: vectors.Rule) -> Callable[..., Value]:
    """Return a handler of x ← rule(x, …), entry by entry."""

    @emits
    def handler(f: Function, node: ast.AST, x: ArrayValue, *others: Value) -> Value:
        vectors.elementwise(f, node, x, [x, *others], rule)
        return NEGLIGIBLE

    return handler


@emits
def copying(f: Function, node: ast.AST, to: ArrayValue, x: ArrayValue) -> Value:
    """Copy an array into another of the same shape, with any strides."""
    if to.kind.ndim != x.kind.ndim or to.kind.frozen or to.kind.number != x.kind.number:
        raise f.refused(node, "a copy between arrays of different axes or types", "use arrays of one kind")
    for i in range(to.kind.ndim):
        same = f.builder.icmp_signed("==", to.shape[i].ir, x.shape[i].ir)
        f.check(same, node, "a copy between arrays of different shapes")
    if to.kind.contiguous and x.kind.contiguous:
        vectors.elementwise(f, node, to, [x], lambda b, x: x)
    else:
        _copied(f, to, x, [])
    return NEGLIGIBLE


def _copied(f: Function, to: ArrayValue, x: ArrayValue, indices: list[Scalar]) -> None:
    if len(indices) == to.kind.ndim:
        arrays.store(f, to, indices, arrays.load(f, x, indices))
        return
    with f.loop(to.shape[len(indices)]) as index:
        _copied(f, to, x, [*indices, index])


@emits
def multiplication(f: Function, node: ast.AST, x: ArrayValue, y: Value, out: ArrayValue) -> Value:
    """Set out to x y, for an array and another array or a number."""
    vectors.elementwise(f, node, out, [x, y], lambda b, x, y: b.fmul(x, y))
    return NEGLIGIBLE


@emits
def _sum_sizes(f: Function, node: ast.AST, x: ArrayValue, out: ArrayValue) -> Value:
    if not (x.kind.contiguous and out.kind.contiguous):
        raise f.refused(node, "a sum over arrays that are not contiguous", "copy them first")
    b, (rows, W) = f.builder, x.shape
    if not isinstance(b, ir.IRBuilder):
        return NEGLIGIBLE
    for width, e in vectors.chunks(f, W, vectors.WIDTHS):
        lanes = Vectors(b, F64, width)
        with b.goto_entry_block():
            total = b.alloca(lanes.type)
        b.store(lanes.constant(0.0), total)
        with vectors.steps(b, vectors.ZERO, rows.ir, 1) as k:
            values = vectors.loaded(b, x.data, b.add(b.mul(k, W.ir), e), width, FLOAT)
            b.store(b.fadd(b.load(total), lanes.intrinsic("fabs", values)), total)
        vectors.stored(b, b.load(total), out.data, e, width, FLOAT)
    return NEGLIGIBLE


@emits
def limitation(f: Function, node: ast.AST, x: ArrayValue, limit: Value) -> Value:
    """Return True if all entries of an array are less than a limit."""
    vectors.check(f, node, x, [])
    if f.silent:
        return Scalar(BOOL, UNWRITTEN)
    b, entry_kind = f.builder, x.kind.number
    most, less = (
        converted(f, scalar(f, limit, node), entry_kind, node),
        b.fcmp_ordered if entry_kind == FLOAT else b.icmp_signed,
    )
    exceeds = _AnyLane(b)
    for width, e in vectors.chunks(f, arrays.size(f, x), vectors.WIDTHS):
        below = less(
            "<", vectors.loaded(b, x.data, e, width, entry_kind), vectors.spread(b, most.ir, width, entry_kind)
        )
        exceeds.add(b.not_(below), width)
    return Scalar(BOOL, b.not_(exceeds.value))


@final
class _AnyLane:
    """Flag that is set if any mask of a loop, of at most 8 lanes, is true in any lane."""

    def __init__(self, b: Builder) -> None:
        self._builder = b
        with b.goto_entry_block():
            self._bits = b.alloca(I8)
        b.store(ir.Constant(I8, 0), self._bits)

    def add(self, mask: ir.Value, width: int) -> None:
        """Include another mask."""
        b, bits = self._builder, self._builder.bitcast(mask, ir.IntType(width))
        b.store(b.or_(b.load(self._bits), bits if width == 8 else b.zext(bits, I8)), self._bits)

    @property
    def value(self) -> ir.Value:
        """Result after the loop."""
        return self._builder.icmp_unsigned("!=", self._builder.load(self._bits), ir.Constant(I8, 0))


@emits
def enclosure(
    f: Function, node: ast.AST, low: ArrayValue, high: ArrayValue, x: ArrayValue, least: Value, most: Value
) -> Value:
    """Extend low and high to enclose x, and return True if an entry of x is outside two limits; x is read once."""
    for bound in (low, high):
        vectors.check(f, node, bound, [x])
    if f.silent:
        return Scalar(BOOL, UNWRITTEN)
    b, (least, most) = f.builder, (real(f, bound, node) for bound in (least, most))
    outside_any = _AnyLane(b)
    for width, e in vectors.chunks(f, arrays.size(f, x), vectors.WIDTHS):
        values, outside = vectors.loaded(b, x.data, e, width, FLOAT), []
        for bound, order, limit in ((low, "<", least), (high, ">", most)):
            current = vectors.loaded(b, bound.data, e, width, FLOAT)
            farther = b.select(b.fcmp_ordered(order, values, current), values, current)
            vectors.stored(b, farther, bound.data, e, width, FLOAT)
            outside.append(b.fcmp_ordered(order, values, vectors.spread(b, limit.ir, width, FLOAT)))
        outside_any.add(b.or_(*outside), width)
    return Scalar(BOOL, outside_any.value)


subtraction = _in_place(lambda b, x, y: b.fsub(x, y))
OPERATIONS: Mapping[Callable[..., object], Callable[..., Value]] = MappingProxyType(
    {
        require: _require, part: _part, weighted_sum: _weighted_sum, np.multiply: multiplication,
        subtract_multiple: _in_place(lambda b, x, y, s: b.fsub(x, b.fmul(y, s))),
        subtract_product: _in_place(lambda b, x, y, z: b.fsub(x, b.fmul(y, z))),
        divide: _in_place(lambda b, x, s: b.fdiv(x, s)), sum_sizes: _sum_sizes,
    }
)  # fmt: skip
