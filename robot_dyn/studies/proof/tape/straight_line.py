"""Programs in the arithmetic of balls, or of truncated power series of balls [Johansson 2017]."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import add, methodcaller, mul, neg, sub, truediv
from typing import Any

from flint import arb

from robot_dyn.codegen.program import Kind, Program
from robot_dyn.errors import ProofError

Function = Callable[[Sequence[Any]], Sequence[Any]]

_MOST = 16.0  # of a constant that CasADi makes: exact halves, far from a rounded decimal


def _tanh(x: Any) -> Any:
    """Tanh x = 1 − 2 / (1 + e²ˣ), of a series; of a ball its own."""
    return x.tanh() if hasattr(x, "tanh") else 1 - 2 / (1 + (x + x).exp())


_OPERATIONS: dict[Kind, Callable[..., Any]] = {
    Kind.ADD: add,
    Kind.SUBTRACT: sub,
    Kind.MULTIPLY: mul,
    Kind.DIVIDE: truediv,
    Kind.NEGATE: neg,
    Kind.SQUARE: lambda x: x * x,
    Kind.TWICE: lambda x: x + x,
    Kind.RECIPROCAL: lambda x: 1 / x,
    Kind.SQUARE_ROOT: methodcaller("sqrt"),
    Kind.EXPONENTIAL: methodcaller("exp"),
    Kind.SINE_COSINE: methodcaller("sin_cos"),
    Kind.HYPERBOLIC_TANGENT: _tanh,
}


def straight_line(program: Program) -> Function:
    """The function of a sequence of all inputs, one after the other, balls or series of balls.

    Raises:
        ProofError: If a constant may have been rounded, or an instruction is not analytic.
    """
    for x in program.constants:
        if not (abs(x) <= _MOST and float(2 * x).is_integer()):
            raise ProofError(f"the trace folded a constant in float64, {x!r}: no theorem could say which number it is")
    for op in program.ops:
        if op.kind not in _OPERATIONS:
            raise ProofError(f"{op.kind.name.lower()} is not analytic: no theorem is proven across it")
    steps = [(_OPERATIONS[op.kind], op.operands, op.results) for op in program.ops]
    constants = [arb(each) for each in program.constants]
    count = 1 + max([sum(program.inputs) + len(constants) - 1, *(i for op in program.ops for i in op.results)])

    def function(x: Sequence[Any]) -> Sequence[Any]:
        values = [*x, *constants]
        values += [None] * (count - len(values))
        for operation, of, made in steps:
            result = operation(*(values[i] for i in of))
            if len(made) == 1:
                values[made[0]] = result
            else:
                values[made[0]], values[made[1]] = result
        return [values[i] for i in program.outputs]

    return function
