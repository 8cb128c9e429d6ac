"""Operations on all entries of arrays, by vectors of the processor; each entry has the bits of a scalar computation."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from llvmlite import ir

from robot_dyn.codegen.loops import arrays
from robot_dyn.codegen.loops.kinds import I64, Number
from robot_dyn.codegen.loops.values import ArrayValue, Builder, Scalar, Value

if TYPE_CHECKING:
    from robot_dyn.codegen.loops.function import Function

WIDTHS = 8, 4, 1
ZERO = ir.Constant(I64, 0)
Rule = Callable[..., ir.Value]  # (builder, numbers or vectors of them) → the same


def elementwise(f: Function, node: ast.AST, to: ArrayValue, operands: list[Value], rule: Rule) -> None:
    """Write rule(operands) into the entries of a contiguous array, from entries of others and from numbers."""
    check(f, node, to, operands)
    if f.silent:
        return
    b, of = f.builder, to.kind.number
    for width, e in chunks(f, arrays.size(f, to), WIDTHS):
        values = [
            loaded(b, x.data, e, width, of) if isinstance(x, ArrayValue) else spread(b, x.ir, width, of)
            for x in operands if isinstance(x, ArrayValue | Scalar)
        ]  # fmt: skip
        stored(b, rule(b, *values), to.data, e, width, of)


def check(f: Function, node: ast.AST, to: ArrayValue, operands: list[Value]) -> None:
    """Check that an array is writable, and others match it: contiguous, of one size and type."""
    for x in operands:
        if isinstance(x, ArrayValue):
            same = f.builder.icmp_signed("==", arrays.size(f, x).ir, arrays.size(f, to).ir)
            f.check(same, node, "arrays of a primitive have different sizes")
            if not (x.kind.contiguous and to.kind.contiguous) or x.kind.number != to.kind.number:
                raise f.refused(
                    node, "a primitive of arrays that are not contiguous or differ in type", "copy them first"
                )
    if to.kind.frozen:
        raise f.refused(node, "a write into a read-only array", "pass a writable one")


def chunks(f: Function, count: Scalar, widths: tuple[int, ...]) -> Iterator[tuple[int, ir.Value]]:
    """Yield loops over entries by vectors: first of the largest width, then of smaller ones for the remainder."""
    b, first = f.builder, ZERO
    for width in widths:
        last = b.and_(count.ir, ir.Constant(I64, -width))
        with steps(b, first, last, width) as e:
            yield width, e
        first = last


@contextmanager
def steps(b: Builder, start: ir.Value, stop: ir.Value, step: int) -> Iterator[ir.Value]:
    """Write a loop in steps, with a phi instead of a variable."""
    before, head, body, done = b.block, *(b.append_basic_block() for _ in range(3))
    b.branch(head)
    b.position_at_end(head)
    index = b.phi(I64)
    index.add_incoming(start, before)
    b.cbranch(b.icmp_signed("<", index, stop), body, done)
    b.position_at_end(body)
    yield index
    index.add_incoming(b.add(index, ir.Constant(I64, step), flags=("nsw",)), b.block)
    b.branch(head)
    b.position_at_end(done)


def kind(width: int, of: Number) -> ir.Type:
    """Return the LLVM type of a vector of numbers."""
    return of.stored if width == 1 else ir.VectorType(of.stored, width)


def loaded(b: Builder, data: ir.Value, at: ir.Value, width: int, of: Number) -> ir.Value:
    """Load a vector of entries."""
    return b.load(b.bitcast(b.gep(data, [at], inbounds=True), kind(width, of).as_pointer()), align=_bytes(of))


def stored(b: Builder, value: ir.Value, data: ir.Value, at: ir.Value, width: int, of: Number) -> None:
    """Store a vector of entries."""
    pointer = b.bitcast(b.gep(data, [at], inbounds=True), kind(width, of).as_pointer())
    b.store(value, pointer, align=_bytes(of))


def spread(b: Builder, x: ir.Value, width: int, of: Number) -> ir.Value:
    """Return a vector with copies of one number."""
    if width == 1:
        return x
    vector, i32 = kind(width, of), ir.IntType(32)
    one = b.insert_element(ir.Constant(vector, ir.Undefined), x, ir.Constant(i32, 0))
    return b.shuffle_vector(one, one, ir.Constant(ir.VectorType(i32, width), [0] * width))


def _bytes(of: Number) -> int:
    return 1 if of.name == "bool" else 8
