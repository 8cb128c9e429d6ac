"""Arithmetic of numbers as in Python and NumPy: floats by IEEE 754, integers of 64 bits with overflow checks.

Nothing is contracted or reordered. Integer overflow and integer division by zero end the call with an error; a float
divided by zero is inf or nan, as in NumPy. Unsigned integers wrap.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from llvmlite import ir

from robot_dyn.codegen.loops.kinds import BOOL, F64, FLOAT, I64, INT, UINT, Kind, Number
from robot_dyn.codegen.loops.values import Scalar, Value, number, word

if TYPE_CHECKING:
    from robot_dyn.codegen.loops.function import Function

_MIN = -(2**63)
Names = Mapping[type[ast.operator], str]
_IN_PYTHON: Mapping[type[ast.operator], Callable[[float, float], object]] = MappingProxyType(
    {
        ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
        ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.Pow: operator.pow,
        ast.BitAnd: operator.and_, ast.BitOr: operator.or_, ast.BitXor: operator.xor,
        ast.LShift: operator.lshift, ast.RShift: operator.rshift,
    }
)  # fmt: skip
_CHECKED: Names = MappingProxyType({ast.Add: "sadd", ast.Sub: "ssub", ast.Mult: "smul"})
_PLAIN: Names = MappingProxyType({ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul"})
_FLOATING: Names = MappingProxyType({ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"})
_BITS: Names = MappingProxyType({ast.BitAnd: "and_", ast.BitOr: "or_", ast.BitXor: "xor"})
_RELATIONS: Mapping[type[ast.cmpop], str] = MappingProxyType(
    {ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
)


def scalar(f: Function, value: Value, node: ast.AST) -> Scalar:
    """Return the value if it is a number; otherwise raise the error."""
    if not isinstance(value, Scalar):
        raise f.refused(
            node, "an operation on a value that is not a number", "write it entry by entry, or with a primitive"
        )
    return value


def converted(f: Function, x: Scalar, kind: Kind, node: ast.AST) -> Scalar:
    """Convert a number to another type without loss: truth value to integer to float, constants to unsigned."""
    if x.kind == kind:
        return x
    if kind == FLOAT and x.kind in (INT, BOOL):
        if x.const is not None and float(x.const) == x.const:
            return number(float(x.const))
        make = f.builder.sitofp if x.kind == INT else f.builder.uitofp
        return Scalar(FLOAT, make(x.ir, F64))
    if kind == INT and x.kind == BOOL:
        return number(int(x.const)) if x.const is not None else Scalar(INT, f.builder.zext(x.ir, I64))
    if kind == UINT and x.kind == INT and x.const is not None and 0 <= x.const < 2**64:
        return word(int(x.const))
    remedy = "convert it with int, float or np.uint64"
    raise f.refused(
        node, f"a number of type {x.kind.name} where {getattr(kind, 'name', 'another')} is required", remedy
    )


def real(f: Function, value: Value, node: ast.AST) -> Scalar:
    """Convert a value that is a number to a float."""
    return converted(f, scalar(f, value, node), FLOAT, node)


def together(f: Function, x: Scalar, y: Scalar, node: ast.AST) -> tuple[Scalar, Scalar]:
    """Convert two numbers to their common type."""
    kinds = {x.kind, y.kind}
    if len(kinds) == 1:
        return x, y
    kind = UINT if UINT in kinds else FLOAT if FLOAT in kinds else INT
    return converted(f, x, kind, node), converted(f, y, kind, node)


def binary(f: Function, operation: type[ast.operator], x: Scalar, y: Scalar, node: ast.AST) -> Scalar:
    """Return the result of an operation on two numbers."""
    if x.const is not None and y.const is not None and UINT not in (x.kind, y.kind):
        return _of_constants(f, operation, x.const, y.const, node)
    if operation in _BITS and x.kind == y.kind and x.kind != FLOAT:
        return Scalar(x.kind, getattr(f.builder, _BITS[operation])(x.ir, y.ir))
    if x.kind == y.kind == BOOL:
        raise f.refused(node, "arithmetic of two truth values", "convert them with int, or write and, or")
    if operation is ast.Pow:
        return _power(f, x, y, node)
    if operation is ast.Div and UINT not in (x.kind, y.kind):
        x, y = converted(f, x, FLOAT, node), converted(f, y, FLOAT, node)
    x, y = together(f, x, y, node)
    if x.kind == FLOAT and operation in _FLOATING:
        return Scalar(FLOAT, getattr(f.builder, _FLOATING[operation])(x.ir, y.ir))
    if x.kind == INT:
        return _of_integers(f, operation, x, y, node)
    if x.kind == UINT and (operation in _PLAIN or operation in (ast.LShift, ast.RShift)):
        return _of_words(f, operation, x, y)
    raise f.refused(
        node, f"{operation.__name__} of numbers of type {x.kind.name}", "convert them, or write it differently"
    )


def _of_constants(f: Function, of: type[ast.operator], x: float, y: float, node: ast.AST) -> Scalar:
    try:
        value = _IN_PYTHON[of](x, y)
    except (ArithmeticError, TypeError, KeyError, ValueError) as error:
        raise f.refused(node, f"an operation on constants ({error})", "correct it") from None
    if not isinstance(value, bool | float) and not (isinstance(value, int) and _MIN <= value < -_MIN):
        raise f.refused(node, f"the constant {value}", "use one of 64 bits")
    return number(value)


def _of_integers(f: Function, of: type[ast.operator], x: Scalar, y: Scalar, node: ast.AST) -> Scalar:
    b = f.builder
    if of in _PLAIN and not f.checks:
        return Scalar(INT, getattr(b, _PLAIN[of])(x.ir, y.ir, flags=("nsw",)))
    if of in _PLAIN:
        both = getattr(b, f"{_CHECKED[of]}_with_overflow")(x.ir, y.ir)
        f.check(b.not_(b.extract_value(both, 1)), node, "an integer overflows 64 bits")
        return Scalar(INT, b.extract_value(both, 0))
    if of in (ast.FloorDiv, ast.Mod):
        return _divided(f, of, x, y, node)
    raise f.refused(node, f"{of.__name__} of integers", "convert them with np.uint64 for operations on bits")


def _divided(f: Function, of: type[ast.operator], x: Scalar, y: Scalar, node: ast.AST) -> Scalar:
    """Return ⌊x / y⌋ or its remainder, which has the sign of y."""
    b, zero, one = f.builder, ir.Constant(I64, 0), ir.Constant(I64, 1)
    if y.const is None or y.const == 0:
        f.check(b.icmp_signed("!=", y.ir, zero), node, "an integer is divided by zero")
    if y.const is None or y.const == -1:
        whole = b.and_(
            b.icmp_signed("==", x.ir, ir.Constant(I64, _MIN)), b.icmp_signed("==", y.ir, ir.Constant(I64, -1))
        )
        f.check(b.not_(whole), node, "an integer overflows 64 bits")
    quotient, rest = b.sdiv(x.ir, y.ir), b.srem(x.ir, y.ir)
    below = b.and_(b.icmp_signed("!=", rest, zero), b.icmp_signed("<", b.xor(rest, y.ir), zero))
    if of is ast.Mod:
        return Scalar(INT, b.select(below, b.add(rest, y.ir), rest))
    return Scalar(INT, b.select(below, b.sub(quotient, one), quotient))


def _of_words(f: Function, of: type[ast.operator], x: Scalar, y: Scalar) -> Scalar:
    b = f.builder
    if of in _PLAIN:
        return Scalar(UINT, getattr(b, _PLAIN[of])(x.ir, y.ir))
    small = b.icmp_unsigned("<", y.ir, ir.Constant(I64, 64))  # LLVM's shift is undefined beyond this
    shifted = (b.shl if of is ast.LShift else b.lshr)(x.ir, b.select(small, y.ir, ir.Constant(I64, 0)))
    return Scalar(UINT, b.select(small, shifted, ir.Constant(I64, 0)))


def _power(f: Function, x: Scalar, y: Scalar, node: ast.AST) -> Scalar:
    """Return a power by the C library, which Python and NumPy use."""
    if x.kind != FLOAT:
        raise f.refused(node, "a power of an integer", "convert it with float, or multiply")
    return Scalar(FLOAT, f.builder.call(f.external("pow", F64, F64, F64), [x.ir, converted(f, y, FLOAT, node).ir]))


def compared(f: Function, relation: type[ast.cmpop], x: Scalar, y: Scalar, node: ast.AST) -> Scalar:
    """Return a relation of two numbers; with nan only != holds."""
    if relation not in _RELATIONS:
        raise f.refused(node, f"the relation {relation.__name__}", "compare numbers with ==, !=, <, <=, > or >=")
    sign = _RELATIONS[relation]
    x, y = together(f, x, y, node)
    b = f.builder
    if x.kind == FLOAT:
        return Scalar(BOOL, (b.fcmp_unordered if sign == "!=" else b.fcmp_ordered)(sign, x.ir, y.ir))
    return Scalar(BOOL, (b.icmp_signed if x.kind == INT else b.icmp_unsigned)(sign, x.ir, y.ir))


def truth(f: Function, x: Scalar) -> ir.Value:
    """Return True if a number is not 0, as LLVM's I1."""
    if x.kind == BOOL:
        return x.ir
    zero = ir.Constant(x.kind.llvm, 0)
    if x.kind == FLOAT:
        return f.builder.fcmp_unordered("!=", x.ir, zero)
    return f.builder.icmp_signed("!=", x.ir, zero)


def negated(f: Function, x: Scalar, node: ast.AST) -> Scalar:
    """Return −x."""
    if x.const is not None and x.kind != BOOL:
        return number(-x.const)
    if x.kind == FLOAT:
        return Scalar(FLOAT, f.builder.fneg(x.ir))
    if x.kind == INT:
        return _of_integers(f, ast.Sub, number(0), x, node)
    raise f.refused(node, f"the negative of a number of type {x.kind.name}", "convert it with int")


def joined(x: Number, y: Number) -> Number | None:
    """Return the type of a variable that includes both; None if there is none."""
    if x == y:
        return x
    return FLOAT if {x, y} == {INT, FLOAT} else None
