"""The instructions of each kind of operation, on vectors of any length; sine and cosine apart."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robot_dyn.codegen.llvm.lanes import Lanes
from robot_dyn.codegen.llvm.tanh import tanh_lanes
from robot_dyn.codegen.llvm.vectors import FLAGS, Vectors
from robot_dyn.codegen.program import Kind

Operation = Callable[..., Any]  # (vectors, x) or (vectors, x, y) → the value


def _arithmetic(instruction: str) -> Operation:
    return lambda vectors, x, y: getattr(vectors.builder, instruction)(x, y, flags=FLAGS)


def _intrinsic(name: str) -> Operation:
    return lambda vectors, *of: vectors.intrinsic(name, *of)


def _library(name: str) -> Operation:
    return lambda vectors, *of: vectors.library(name, *of)


def _compared(sign: str) -> Operation:
    return lambda vectors, x, y: _truth(vectors, _ordered(vectors, sign, x, y))


def _chosen(sign: str) -> Operation:
    return lambda vectors, x, y: vectors.builder.select(_ordered(vectors, sign, x, y), x, y)


def _ordered(vectors: Vectors, sign: str, x: Any, y: Any) -> Any:
    """The mask of a comparison that NaN does not fulfil."""
    return vectors.builder.fcmp_ordered(sign, x, y)


def _holds(vectors: Vectors, x: Any) -> Any:
    """The mask of a condition: what is not 0, NaN too."""
    return vectors.builder.fcmp_unordered("!=", x, vectors.constant(0.0))


def _truth(vectors: Vectors, mask: Any) -> Any:
    """1 or 0 of a mask."""
    return vectors.builder.select(mask, vectors.constant(1.0), vectors.constant(0.0))


def _not_equal(vectors: Vectors, x: Any, y: Any) -> Any:
    return _truth(vectors, vectors.builder.fcmp_unordered("!=", x, y))


def _sign(vectors: Vectors, x: Any) -> Any:
    zero, select = vectors.constant(0.0), vectors.builder.select
    negative = select(_ordered(vectors, "<", x, zero), vectors.constant(-1.0), x)
    return select(_ordered(vectors, ">", x, zero), vectors.constant(1.0), negative)


def _tanh(vectors: Vectors, x: Any) -> Any:
    return tanh_lanes(Lanes(vectors.builder, x, vectors.kind, vectors.count)).value


_ADD, _MULTIPLY, _DIVIDE = _arithmetic("fadd"), _arithmetic("fmul"), _arithmetic("fdiv")

OPERATIONS: dict[Kind, Operation] = {
    Kind.ADD: _ADD,
    Kind.SUBTRACT: _arithmetic("fsub"),
    Kind.MULTIPLY: _MULTIPLY,
    Kind.DIVIDE: _DIVIDE,
    Kind.NEGATE: lambda vectors, x: vectors.builder.fneg(x, flags=FLAGS),
    Kind.SQUARE: lambda vectors, x: _MULTIPLY(vectors, x, x),
    Kind.TWICE: lambda vectors, x: _ADD(vectors, x, x),
    Kind.RECIPROCAL: lambda vectors, x: _DIVIDE(vectors, vectors.constant(1.0), x),
    Kind.ABSOLUTE: _intrinsic("fabs"),
    Kind.SIGN: _sign,
    Kind.FLOOR: _intrinsic("floor"),
    Kind.CEILING: _intrinsic("ceil"),
    Kind.MINIMUM: _chosen("<"),
    Kind.MAXIMUM: _chosen(">"),
    Kind.COPY_SIGN: _intrinsic("copysign"),
    Kind.REMAINDER: _library("fmod"),
    Kind.SQUARE_ROOT: _intrinsic("sqrt"),
    Kind.HYPOTENUSE: _library("hypot"),
    Kind.POWER: _library("pow"),
    Kind.EXPONENTIAL: _library("exp"),
    Kind.LOGARITHM: _library("log"),
    Kind.TANGENT: _library("tan"),
    Kind.ARC_SINE: _library("asin"),
    Kind.ARC_COSINE: _library("acos"),
    Kind.ARC_TANGENT: _library("atan"),
    Kind.ARC_TANGENT_OF_TWO: _library("atan2"),
    Kind.HYPERBOLIC_SINE: _library("sinh"),
    Kind.HYPERBOLIC_COSINE: _library("cosh"),
    Kind.HYPERBOLIC_TANGENT: _tanh,
    Kind.LESS: _compared("<"),
    Kind.LESS_OR_EQUAL: _compared("<="),
    Kind.EQUAL: _compared("=="),
    Kind.NOT_EQUAL: _not_equal,
    Kind.NOT: lambda vectors, x: _truth(vectors, _ordered(vectors, "==", x, vectors.constant(0.0))),
    Kind.AND: lambda vectors, x, y: _truth(vectors, vectors.builder.and_(_holds(vectors, x), _holds(vectors, y))),
    Kind.OR: lambda vectors, x, y: _truth(vectors, vectors.builder.or_(_holds(vectors, x), _holds(vectors, y))),
    Kind.WHERE: lambda vectors, x, y: vectors.builder.select(_holds(vectors, x), y, vectors.constant(0.0)),
}
