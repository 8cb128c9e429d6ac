"""LLVM instructions for each kind of operation except sine and cosine, on vectors of any length."""

from __future__ import annotations

from collections.abc import Callable

from llvmlite import ir

from robot_dyn.codegen.llvm.elementary import tanh
from robot_dyn.codegen.llvm.vectors import FLAGS, Lanes, Vectors
from robot_dyn.codegen.program import Kind

Operation = Callable[..., ir.Value]  # (vectors, x) or (vectors, x, y) → the value


def _arithmetic(instruction: str) -> Operation:
    return lambda vectors, x, y: getattr(vectors.builder, instruction)(x, y, flags=FLAGS)


def _intrinsic(name: str) -> Operation:
    return lambda vectors, *operands: vectors.intrinsic(name, *operands)


def _library(name: str) -> Operation:
    return lambda vectors, *operands: vectors.library(name, *operands)


def _compared(sign: str) -> Operation:
    return lambda vectors, x, y: _truth(vectors, _ordered(vectors, sign, x, y))


def _chosen(sign: str) -> Operation:
    return lambda vectors, x, y: vectors.builder.select(_ordered(vectors, sign, x, y), x, y)


def _ordered(vectors: Vectors, sign: str, x: ir.Value, y: ir.Value) -> ir.Value:
    """Return the mask of a comparison; false if an operand is NaN."""
    return vectors.builder.fcmp_ordered(sign, x, y)


def _holds(vectors: Vectors, x: ir.Value) -> ir.Value:
    """Return the mask of a condition: true for any value other than 0, including NaN."""
    return vectors.builder.fcmp_unordered("!=", x, vectors.constant(0.0))


def _truth(vectors: Vectors, mask: ir.Value) -> ir.Value:
    """Convert a mask to 1.0 or 0.0."""
    return vectors.builder.select(mask, vectors.constant(1.0), vectors.constant(0.0))


def _sign(vectors: Vectors, x: ir.Value) -> ir.Value:
    zero, select = vectors.constant(0.0), vectors.builder.select
    negative = select(_ordered(vectors, "<", x, zero), vectors.constant(-1.0), x)
    return select(_ordered(vectors, ">", x, zero), vectors.constant(1.0), negative)


_ADD, _MULTIPLY, _DIVIDE = _arithmetic("fadd"), _arithmetic("fmul"), _arithmetic("fdiv")
_INTRINSICS = Kind.ABSOLUTE, Kind.FLOOR, Kind.CEILING, Kind.COPY_SIGN, Kind.SQUARE_ROOT
_OF_LIBRARY = (
    Kind.REMAINDER, Kind.HYPOTENUSE, Kind.POWER, Kind.EXPONENTIAL, Kind.LOGARITHM, Kind.TANGENT, Kind.ARC_SINE,
    Kind.ARC_COSINE, Kind.ARC_TANGENT, Kind.ARC_TANGENT_OF_TWO, Kind.HYPERBOLIC_SINE, Kind.HYPERBOLIC_COSINE,
)  # fmt: skip

OPERATIONS: dict[Kind, Operation] = {
    **{kind: _intrinsic(kind.value) for kind in _INTRINSICS},
    **{kind: _library(kind.value) for kind in _OF_LIBRARY},
    Kind.ADD: _ADD,
    Kind.SUBTRACT: _arithmetic("fsub"),
    Kind.MULTIPLY: _MULTIPLY,
    Kind.DIVIDE: _DIVIDE,
    Kind.NEGATE: lambda vectors, x: vectors.builder.fneg(x, flags=FLAGS),
    Kind.SQUARE: lambda vectors, x: _MULTIPLY(vectors, x, x),
    Kind.TWICE: lambda vectors, x: _ADD(vectors, x, x),
    Kind.RECIPROCAL: lambda vectors, x: _DIVIDE(vectors, vectors.constant(1.0), x),
    Kind.SIGN: _sign,
    Kind.MINIMUM: _chosen("<"),
    Kind.MAXIMUM: _chosen(">"),
    Kind.HYPERBOLIC_TANGENT: lambda vectors, x: tanh(Lanes(vectors, x)).value,
    Kind.LESS: _compared("<"),
    Kind.LESS_OR_EQUAL: _compared("<="),
    Kind.EQUAL: _compared("=="),
    Kind.NOT_EQUAL: lambda vectors, x, y: _truth(vectors, vectors.builder.fcmp_unordered("!=", x, y)),
    Kind.NOT: lambda vectors, x: _truth(vectors, _ordered(vectors, "==", x, vectors.constant(0.0))),
    Kind.AND: lambda vectors, x, y: _truth(vectors, vectors.builder.and_(_holds(vectors, x), _holds(vectors, y))),
    Kind.OR: lambda vectors, x, y: _truth(vectors, vectors.builder.or_(_holds(vectors, x), _holds(vectors, y))),
    Kind.WHERE: lambda vectors, x, y: vectors.builder.select(_holds(vectors, x), y, vectors.constant(0.0)),
}
