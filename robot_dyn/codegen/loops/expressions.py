"""Expressions of the subset."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from llvmlite import ir

from robot_dyn.codegen.loops import arrays, calls, numbers
from robot_dyn.codegen.loops.kinds import BOOL, I64, RecordKind, Static, TupleKind
from robot_dyn.codegen.loops.values import (
    UNWRITTEN,
    ArrayValue,
    RecordValue,
    Scalar,
    StaticValue,
    TupleValue,
    Value,
    leaf_types,
    leaves,
    number,
    of_leaves,
)  # fmt: skip

if TYPE_CHECKING:
    from robot_dyn.codegen.loops.function import Function


def value(f: Function, node: ast.expr) -> Value:
    """Return the value of an expression."""
    if type(node) not in EXPRESSIONS:
        raise f.refused(
            node, f"the expression {ast.unparse(node)} ({type(node).__name__})", "write it with plain loops"
        )
    return EXPRESSIONS[type(node)](f, node)


def _constant(f: Function, node: ast.Constant) -> Value:
    return f.constant(node.value, node)


def _tuple(f: Function, node: ast.Tuple) -> Value:
    return TupleValue(tuple(value(f, item) for item in node.elts))


def _attribute(f: Function, node: ast.Attribute) -> Value:
    owner = value(f, node.value)
    if isinstance(owner, StaticValue) and hasattr(owner.value, node.attr):
        return f.constant(getattr(owner.value, node.attr), node)
    if isinstance(owner, RecordValue) and node.attr in owner.kind.names:
        return field(f, owner, node.attr)
    if isinstance(owner, ArrayValue):
        if node.attr == "shape":
            return TupleValue(owner.shape)
        if node.attr == "size":
            return arrays.size(f, owner)
        if node.attr == "ndim":
            return number(owner.kind.ndim)
    raise f.refused(node, f"the attribute {ast.unparse(node)}", "use fields of named tuples, or shape, size and ndim")


def field(f: Function, record: RecordValue, name: str) -> Value:
    """Return a field of a named tuple; its words do not change while machine code runs."""
    kind, first = record.kind.kinds[record.kind.names.index(name)], record.kind.first(name)
    if isinstance(kind, RecordKind):
        return RecordValue(kind, f.builder.gep(record.pointer, [ir.Constant(I64, first)]))
    if isinstance(kind, TupleKind):
        raise f.refused(f.tree, f"the tuple {name!r} in a named tuple", "use a named tuple")
    if f.silent or isinstance(kind, Static):
        return of_leaves(kind, [UNWRITTEN] * len(leaf_types(kind)))
    return f.program.read(f.builder, record.pointer, kind, first)


def _subscript(f: Function, node: ast.Subscript) -> Value:
    owner = value(f, node.value)
    if isinstance(owner, ArrayValue):
        return arrays.subscript(f, owner, node)
    if isinstance(owner, StaticValue) and isinstance(owner.value, tuple):
        owner = TupleValue(tuple(f.constant(item, node) for item in owner.value))
    if isinstance(owner, TupleValue) and not isinstance(node.slice, ast.Slice):
        return _item(f, owner, numbers.scalar(f, value(f, node.slice), node), node)
    raise f.refused(node, f"the subscript {ast.unparse(node)}", "use entries of arrays and tuples")


def _item(f: Function, values: TupleValue, index: Scalar, node: ast.AST) -> Value:
    """Return an item of a tuple; if the index is not constant, all items must have one type."""
    count = len(values.items)
    if index.const is not None:
        if not -count <= index.const < count:
            raise f.refused(node, f"the item {index.const} of {count}", "use an existing item")
        return values.items[int(index.const)]
    if len({item.kind for item in values.items}) != 1 or not isinstance(values.items[0], Scalar):
        raise f.refused(node, "an item of a tuple by a variable index", "use a tuple of numbers of one type")
    index = arrays.index_within(f, index, number(count), node)
    first, *others = values.items
    chosen = first.ir  # pyright: ignore
    for i, item in enumerate(others, 1):
        here = f.builder.icmp_signed("==", index.ir, ir.Constant(I64, i))
        chosen = f.builder.select(here, item.ir, chosen)  # pyright: ignore
    return Scalar(first.kind, chosen)  # pyright: ignore


def _binary(f: Function, node: ast.BinOp) -> Value:
    x, y = (numbers.scalar(f, value(f, operand), node) for operand in (node.left, node.right))
    return numbers.binary(f, type(node.op), x, y, node)


def _unary(f: Function, node: ast.UnaryOp) -> Value:
    if isinstance(node.op, ast.Not):
        return Scalar(BOOL, f.builder.not_(test(f, node.operand)))
    x = numbers.scalar(f, value(f, node.operand), node)
    if isinstance(node.op, ast.USub):
        return numbers.negated(f, x, node)
    raise f.refused(node, f"the operation {ast.unparse(node)}", "write it differently")


def _logic(f: Function, node: ast.BoolOp) -> Value:
    """Return the value of `and` or `or`; later operands are computed only if they matter."""

    def item(operand: ast.expr) -> ir.Value:
        x = numbers.scalar(f, value(f, operand), operand)
        if x.kind != BOOL:
            raise f.refused(operand, "and, or of values that are not truth values", "compare them, as in x != 0")
        return x.ir

    return Scalar(BOOL, _shortened(f, node.values, isinstance(node.op, ast.And), item))


def _shortened(f: Function, nodes: list[ast.expr], all_: bool, item: Callable[[ast.expr], ir.Value]) -> ir.Value:
    """Return whether all or any of the operands hold, computed in sequence until the result is decided."""
    b, b0 = f.builder, ir.Constant(BOOL.llvm, int(not all_))
    done = b.append_basic_block()
    ends = []
    for operand in nodes[:-1]:
        holds, more = item(operand), b.append_basic_block()
        ends.append((b0, b.block))
        b.cbranch(holds, *((more, done) if all_ else (done, more)))
        b.position_at_end(more)
    ends.append((item(nodes[-1]), b.block))
    b.branch(done)
    b.position_at_end(done)
    return _merged(f, BOOL.llvm, ends)


def _merged(f: Function, kind: ir.Type, ends: list[tuple[ir.Value, ir.Block]]) -> ir.Value:
    if f.silent:
        return UNWRITTEN
    phi = f.builder.phi(kind)
    for value_, block in ends:
        phi.add_incoming(value_, block)
    return phi


def test(f: Function, node: ast.expr) -> ir.Value:
    """Return whether an expression holds, as LLVM's I1: numbers hold unless they are 0."""
    if isinstance(node, ast.BoolOp):
        return _shortened(f, node.values, isinstance(node.op, ast.And), lambda operand: test(f, operand))
    return numbers.truth(f, numbers.scalar(f, value(f, node), node))


def _number(f: Function, operand: ast.expr, node: ast.AST) -> Scalar:
    """Return the value of an operand that is a number."""
    return numbers.scalar(f, value(f, operand), node)


def _comparison(f: Function, node: ast.Compare) -> Value:
    """Return the value of a chain of relations, each computed only if those before it hold."""
    left, ends, b = numbers.scalar(f, value(f, node.left), node), [], f.builder
    if len(node.ops) == 1:
        return numbers.compared(f, type(node.ops[0]), left, _number(f, node.comparators[0], node), node)
    done = b.append_basic_block()
    for i, (op, operand) in enumerate(zip(node.ops, node.comparators, strict=True)):
        right = _number(f, operand, node)
        holds = numbers.compared(f, type(op), left, right, node)
        last = i == len(node.ops) - 1
        more = done if last else b.append_basic_block()
        ends.append((holds.ir if last else ir.Constant(BOOL.llvm, 0), b.block))
        b.branch(more) if last else b.cbranch(holds.ir, more, done)
        b.position_at_end(more)
        left = right
    return Scalar(BOOL, _merged(f, BOOL.llvm, ends))


def _conditional(f: Function, node: ast.IfExp) -> Value:
    b = f.builder
    yes, no, done = (b.append_basic_block() for _ in range(3))
    b.cbranch(test(f, node.test), yes, no)
    values, ends = [], []
    for block, branch in ((yes, node.body), (no, node.orelse)):
        b.position_at_end(block)
        values.append(value(f, branch))
        ends.append(b.block)
    return _either(f, node, values, ends, done)


def _either(f: Function, node: ast.AST, values: list[Value], ends: list[ir.Block], done: ir.Block) -> Value:
    """Return one of two values, depending on the preceding block."""
    kind, b = f.common(values[0].kind, values[1].kind, node), f.builder
    parts = []
    for option, block in zip(values, ends, strict=True):
        b.position_at_end(block)
        parts.append(leaves(f.fitted(option, kind, node)))
        b.branch(done)
    b.position_at_end(done)
    if f.silent:
        return of_leaves(kind, [UNWRITTEN] * len(leaf_types(kind)))
    columns = zip(*parts, strict=True)
    kinds = leaf_types(kind)
    merged = [_merged(f, t, list(zip(x, ends, strict=True))) for t, x in zip(kinds, columns, strict=True)]
    return of_leaves(kind, merged)


EXPRESSIONS: Mapping[type[ast.expr], Callable[[Any, Any], Value]] = MappingProxyType(
    {
        ast.Constant: _constant, ast.Name: lambda f, node: f.name(node), ast.Tuple: _tuple, ast.Attribute: _attribute,
        ast.Subscript: _subscript, ast.BinOp: _binary, ast.UnaryOp: _unary, ast.BoolOp: _logic,
        ast.Compare: _comparison, ast.IfExp: _conditional, ast.Call: calls.called,
    }
)  # fmt: skip
