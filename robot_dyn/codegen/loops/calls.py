"""Calls: of functions that are also translated, of substitutes, and of some functions of Python and NumPy."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from functools import partial
from types import FunctionType, MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from llvmlite import ir

from robot_dyn.codegen.loops import arrays, numbers
from robot_dyn.codegen.loops.kinds import F64, FLOAT, I64, INT, TEXT, UINT
from robot_dyn.codegen.loops.values import (
    UNWRITTEN,
    ArrayValue,
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

Handler = Callable[..., Value]  # (f, node, arguments) → value


def called(f: Function, node: ast.Call) -> Value:
    """Return the result of a call."""
    if node.keywords or any(isinstance(argument, ast.Starred) for argument in node.args):
        raise f.refused(node, "an argument by name, or unpacked with *", "pass arguments by position")
    if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
        return _reshape(f, node, node.func.value)
    function, arguments = f.expression(node.func), [f.expression(argument) for argument in node.args]
    callee = function.value if isinstance(function, StaticValue) else None
    handler = f.program.instead.get(callee) if callable(callee) else None
    if isinstance(handler, FunctionType) and not hasattr(handler, "emits"):
        return _translated(f, node, handler, arguments)
    handler = handler or _HANDLERS.get(callee) if callable(callee) else None
    if handler is not None:
        try:
            return handler(f, node, *arguments)
        except TypeError as error:
            raise f.refused(
                node, f"the call {ast.unparse(node)} ({error})", "see docs/developers/extending.md"
            ) from None
    if isinstance(callee, FunctionType):
        return _translated(f, node, callee, arguments)
    callables = (
        "plain functions, abs, min, max, len, float, int, np.sqrt, np.sign, np.spacing, np.nextafter, math.frexp"
    )
    raise f.refused(node, f"the call {ast.unparse(node)}", f"call {callables}, or a primitive")


def _translated(f: Function, node: ast.Call, function: FunctionType, arguments: list[Value]) -> Value:
    """Return the result of another function, which is translated for these types."""
    written = f.program.written(function, tuple(argument.kind for argument in arguments), partial(f.refuse, node))
    f.may_fail |= written.may_fail
    parts = leaf_types(written.result)
    if f.silent:
        return of_leaves(written.result, [UNWRITTEN] * len(parts))
    b = f.builder
    returned = b.call(written.ir, [leaf for argument in arguments for leaf in leaves(argument)])
    count = written.may_fail + len(parts)
    results: list[ir.Value] = [returned] if count == 1 else [b.extract_value(returned, i) for i in range(count)]
    if written.may_fail:
        f.fail_unless(b.icmp_unsigned("==", results[0], ir.Constant(TEXT, None)), results[0])
    return of_leaves(written.result, results[written.may_fail :])


def _reshape(f: Function, node: ast.Call, of: ast.expr) -> Value:
    x = f.expression(of)
    shape = f.expression(node.args[0]) if len(node.args) == 1 else None
    if isinstance(shape, Scalar):
        shape = TupleValue((shape,))
    if not isinstance(x, ArrayValue) or not isinstance(shape, TupleValue):
        raise f.refused(node, f"the call {ast.unparse(node)}", "reshape an array to a tuple of lengths")
    return arrays.reshaped(f, x, [numbers.scalar(f, length, node) for length in shape.items], node)


def _abs(f: Function, node: ast.AST, x: Value) -> Value:
    x = numbers.scalar(f, x, node)
    if x.kind == INT:
        below = f.builder.icmp_signed("<", x.ir, ir.Constant(I64, 0))
        return Scalar(INT, f.builder.select(below, numbers.negated(f, x, node).ir, x.ir))
    return Scalar(FLOAT, f.intrinsic("fabs", numbers.real(f, x, node).ir))


def _extreme(sign: str) -> Handler:
    """Return a handler of min or max: the first extreme number as in Python; nan is neither above nor below."""
    relation = ast.Gt if sign == ">" else ast.Lt

    def extreme(f: Function, node: ast.AST, *values: Value) -> Value:
        if len(values) < 2:
            raise f.refused(node, "min or max of one argument", "give two or more numbers")
        best, *others = (numbers.scalar(f, value, node) for value in values)
        for other in others:
            best, other = numbers.together(f, best, other, node)
            better = numbers.compared(f, relation, other, best, node)
            best = Scalar(best.kind, f.builder.select(better.ir, other.ir, best.ir))
        return best

    return extreme


def _len(f: Function, node: ast.AST, x: Value) -> Value:
    if isinstance(x, ArrayValue):
        return x.shape[0]
    count = len(x.items) if isinstance(x, TupleValue) else len(getattr(x, "value", ""))
    return number(count)


def _float(f: Function, node: ast.AST, x: Value) -> Value:
    x = numbers.scalar(f, x, node)
    if x.kind == UINT:
        return Scalar(FLOAT, f.builder.uitofp(x.ir, F64))
    return numbers.converted(f, x, FLOAT, node)


def _int(f: Function, node: ast.AST, x: Value) -> Value:
    """Round a number towards 0; check that it fits 64 bits."""
    x, b = numbers.scalar(f, x, node), f.builder
    if x.kind == FLOAT:
        size = f.intrinsic("fabs", x.ir)
        f.check(
            b.fcmp_ordered("<", size, ir.Constant(F64, 2.0**63)), node, "a float does not fit an integer of 64 bits"
        )
        return Scalar(INT, b.fptosi(x.ir, I64))
    if x.kind == UINT:
        f.check(b.icmp_signed(">=", x.ir, ir.Constant(I64, 0)), node, "an integer overflows 64 bits")
        return Scalar(INT, x.ir)
    return numbers.converted(f, x, INT, node)


def _word(f: Function, node: ast.AST, x: Value) -> Value:
    x = numbers.scalar(f, x, node)
    if x.kind == INT and x.const is None:
        f.check(f.builder.icmp_signed(">=", x.ir, ir.Constant(I64, 0)), node, "np.uint64 of a negative number")
        return Scalar(UINT, x.ir)
    return numbers.converted(f, x, UINT, node)


def _sqrt(f: Function, node: ast.AST, x: Value) -> Value:
    return Scalar(FLOAT, f.intrinsic("sqrt", numbers.real(f, x, node).ir))


def _sign(f: Function, node: ast.AST, x: Value) -> Value:
    """Return the sign of a float: 0 for ±0, nan for nan."""
    x, b, zero = numbers.real(f, x, node), f.builder, ir.Constant(F64, 0.0)
    sign = b.select(b.fcmp_ordered("<", x.ir, zero), ir.Constant(F64, -1.0), x.ir)
    sign = b.select(b.fcmp_ordered(">", x.ir, zero), ir.Constant(F64, 1.0), sign)
    return Scalar(FLOAT, b.select(b.fcmp_ordered("==", x.ir, zero), zero, sign))


def _nextafter(f: Function, node: ast.AST, x: Value, y: Value) -> Value:
    both = [numbers.real(f, value, node).ir for value in (x, y)]
    return Scalar(FLOAT, f.builder.call(f.external("nextafter", F64, F64, F64), both))


def _spacing(f: Function, node: ast.AST, x: Value) -> Value:
    """Return the distance to the next float away from 0."""
    x, b = numbers.real(f, x, node), f.builder
    size = f.intrinsic("fabs", x.ir)
    following = b.call(f.external("nextafter", F64, F64, F64), [size, ir.Constant(F64, math.inf)])
    return Scalar(FLOAT, f.intrinsic("copysign", b.fsub(following, size), x.ir))


def _frexp(f: Function, node: ast.AST, x: Value) -> Value:
    """Return m and e of x = m 2ᵉ."""
    x, b = numbers.real(f, x, node), f.builder
    if f.silent:
        return TupleValue((Scalar(FLOAT, UNWRITTEN), Scalar(INT, UNWRITTEN)))
    i32 = ir.IntType(32)
    with b.goto_entry_block():
        slot = b.alloca(i32)
    m = b.call(f.external("frexp", F64, F64, i32.as_pointer()), [x.ir, slot])
    return TupleValue((Scalar(FLOAT, m), Scalar(INT, b.sext(b.load(slot), I64))))


_HANDLERS: Mapping[Callable[..., object], Handler] = MappingProxyType(
    {
        abs: _abs, min: _extreme("<"), max: _extreme(">"), len: _len, float: _float, int: _int, np.uint64: _word,
        np.sqrt: _sqrt, np.sign: _sign, np.spacing: _spacing, np.nextafter: _nextafter, math.frexp: _frexp,
    }
)  # fmt: skip
