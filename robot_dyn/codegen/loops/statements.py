"""Statements of the subset. Each function returns True if the code after the statement is unreachable."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from llvmlite import ir

from robot_dyn.codegen.loops import arrays, expressions, numbers
from robot_dyn.codegen.loops.kinds import I64, INT
from robot_dyn.codegen.loops.values import (
    UNWRITTEN,
    ArrayValue,
    Builder,
    Scalar,
    StaticValue,
    TupleValue,
    Value,
    number,
)  # fmt: skip

if TYPE_CHECKING:
    from robot_dyn.codegen.loops.function import Function


def block(f: Function, nodes: list[ast.stmt]) -> bool:
    """Compile statements in sequence."""
    for node in nodes:
        if type(node) not in STATEMENTS:
            statement = f"the statement {type(node).__name__}"
            raise f.refused(node, statement, "use assignments, if, for over range or an array, while and return")
        if STATEMENTS[type(node)](f, node):
            return True
    return False


def _assign(f: Function, node: ast.Assign) -> bool:
    value = f.expression(node.value)
    for target in node.targets:
        _store(f, target, value, node)
    return False


def _annotated(f: Function, node: ast.AnnAssign) -> bool:
    if node.value is None:
        raise f.refused(node, "an annotation without a value", "assign a value")
    _store(f, node.target, f.expression(node.value), node)
    return False


def _store(f: Function, target: ast.expr, value: Value, node: ast.AST) -> None:
    if isinstance(target, ast.Name):
        f.assign(target.id, value, node)
    elif isinstance(target, ast.Tuple | ast.List):
        if not isinstance(value, TupleValue) or len(value.items) != len(target.elts):
            raise f.refused(node, "unpacking into another number of names", "use a tuple with one item for each name")
        for part, item in zip(target.elts, value.items, strict=True):
            _store(f, part, item, node)
    elif isinstance(target, ast.Subscript) and isinstance(x := f.expression(target.value), ArrayValue):
        arrays.store_at(f, x, target, value)
    else:
        raise f.refused(node, f"an assignment to {ast.unparse(target)}", "assign to names and entries of arrays")


def _augmented(f: Function, node: ast.AugAssign) -> bool:
    """Compile x op= y; the indices of x are evaluated only once."""
    op, target = type(node.op), node.target
    if isinstance(target, ast.Name):
        x = numbers.scalar(f, f.name(ast.copy_location(ast.Name(target.id, ast.Load()), target)), node)
        new = numbers.binary(f, op, x, numbers.scalar(f, f.expression(node.value), node), node)
        f.assign(target.id, new, node)
        return False
    array = f.expression(target.value) if isinstance(target, ast.Subscript) else None
    if not isinstance(array, ArrayValue) or not isinstance(target, ast.Subscript):
        raise f.refused(node, f"an assignment to {ast.unparse(target)}", "assign to names and entries of arrays")
    if array.kind.frozen:
        raise f.refused(node, "a write into a read-only array", "pass a writable one")
    places = arrays.indices(f, array, target)
    x = arrays.load(f, array, places)
    new = numbers.binary(f, op, x, numbers.scalar(f, f.expression(node.value), node), node)
    arrays.store(f, array, places, numbers.converted(f, new, array.kind.number, node))
    return False


def _if(f: Function, node: ast.If) -> bool:
    b = f.builder
    yes, no, done = (b.append_basic_block() for _ in range(3))
    b.cbranch(expressions.test(f, node.test), yes, no)
    before, ends = set(f.assigned), []
    for start, nodes in ((yes, node.body), (no, node.orelse)):
        b.position_at_end(start)
        f.assigned = set(before)
        ended = block(f, nodes)
        if not ended:
            ends.append(f.assigned)
            b.branch(done)
    if not ends:
        if not f.silent:
            b.function.blocks.remove(done)
        return True
    f.assigned = set.intersection(*ends)
    b.position_at_end(done)
    return False


def _while(f: Function, node: ast.While) -> bool:
    _no_else(f, node)
    b = f.builder
    endless = isinstance(node.test, ast.Constant) and node.test.value is True
    head, done = b.append_basic_block(), b.append_basic_block()
    b.branch(head)
    b.position_at_end(head)
    if not endless:
        body = b.append_basic_block()
        b.cbranch(expressions.test(f, node.test), body, done)
        b.position_at_end(body)
    before = set(f.assigned)
    breaks = _body(f, node.body, head, done)
    f.assigned = before if not endless else set.intersection(*breaks) if breaks else before
    if endless and not breaks:
        if not f.silent:
            b.function.blocks.remove(done)
        return True
    b.position_at_end(done)
    return False


def _for(f: Function, node: ast.For) -> bool:
    _no_else(f, node)
    over = _range(f, node.iter)
    array = None if over else f.expression(node.iter)
    if over is None and not (isinstance(array, ArrayValue) and array.kind.ndim == 1):
        raise f.refused(node, f"a loop over {ast.unparse(node.iter)}", "use a range, or an array with one axis")
    start, stop, step = over or (number(0), array.shape[0], 1)  # pyright: ignore
    before = set(f.assigned)
    with counted(f, start, stop, step) as (index, (following, done)):
        item = index if array is None else arrays.load(f, array, [index])  # pyright: ignore
        _store(f, node.target, item, node)
        _body(f, node.body, following, done)
    f.assigned = before
    return False


@contextmanager
def counted(f: Function, start: Scalar, stop: Scalar, step: int) -> Iterator[tuple[Scalar, tuple[ir.Block, ir.Block]]]:
    """Compile a loop over a range; yield its index and two blocks: the next iteration, and the code after the loop."""
    b = f.builder
    slot = UNWRITTEN if f.silent else _slot(b)
    b.store(start.ir, slot)
    head, body, following, done = (b.append_basic_block(name) for name in ("head", "body", "next", "done"))
    b.branch(head)
    b.position_at_end(head)
    index = b.load(slot)
    b.cbranch(b.icmp_signed("<" if step > 0 else ">", index, stop.ir), body, done)
    b.position_at_end(body)
    yield Scalar(INT, index), (following, done)
    if not f.silent and not b.block.is_terminated:
        b.branch(following)
    b.position_at_end(following)
    b.store(b.add(index, ir.Constant(I64, step), flags=("nsw",)), slot)
    b.branch(head)
    b.position_at_end(done)


def _slot(b: Builder) -> ir.Value:
    """Reserve memory for a counter at the start of the function, so that loops do not exhaust the stack."""
    with b.goto_entry_block():
        return b.alloca(I64)


def _range(f: Function, node: ast.expr) -> tuple[Scalar, Scalar, int] | None:
    """Return start, stop and step of a call of range; None for any other expression."""
    if not isinstance(node, ast.Call):
        return None
    function = f.expression(node.func)
    if not (isinstance(function, StaticValue) and function.value is range) or node.keywords:
        return None
    bounds = [
        numbers.converted(f, numbers.scalar(f, f.expression(argument), node), INT, node) for argument in node.args
    ]
    start, stop = (number(0), bounds[0]) if len(bounds) == 1 else bounds[:2]
    step = bounds[2] if len(bounds) == 3 else number(1)
    if not step.const:
        raise f.refused(node, "a range whose step is 0 or not a constant", "write a while loop")
    return start, stop, int(step.const)


def _body(f: Function, nodes: list[ast.stmt], following: ir.Block, done: ir.Block) -> list[set[str]]:
    """Write the body of a loop; return the names assigned at each of its breaks."""
    breaks: list[set[str]] = []
    f.leaving.append((following, done, breaks))
    if not block(f, nodes):
        f.builder.branch(following)
    f.leaving.pop()
    return breaks


def _no_else(f: Function, node: ast.While | ast.For) -> None:
    if node.orelse:
        raise f.refused(node, "else of a loop", "set a truth value before each break")


def _break(f: Function, node: ast.Break) -> bool:
    _, done, breaks = f.leaving[-1]
    breaks.append(set(f.assigned))
    f.builder.branch(done)
    return True


def _continue(f: Function, node: ast.Continue) -> bool:
    f.builder.branch(f.leaving[-1][0])
    return True


def _return(f: Function, node: ast.Return) -> bool:
    f.give(StaticValue(None) if node.value is None else f.expression(node.value), node)
    return True


def _expression(f: Function, node: ast.Expr) -> bool:
    if not isinstance(node.value, ast.Constant):  # a docstring compiles to nothing
        f.expression(node.value)
    return False


STATEMENTS: Mapping[type[ast.stmt], Callable[[Any, Any], bool]] = MappingProxyType(
    {
        ast.Assign: _assign, ast.AnnAssign: _annotated, ast.AugAssign: _augmented, ast.If: _if, ast.While: _while,
        ast.For: _for, ast.Break: _break, ast.Continue: _continue, ast.Return: _return, ast.Expr: _expression,
        ast.Pass: lambda f, node: False,
    }
)  # fmt: skip
