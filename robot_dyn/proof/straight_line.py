"""Programs as Python functions of balls, or of truncated power series of balls: one line for each instruction.

Values are numbered, so no text of a file can reach the code. [Johansson 2017]
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from flint import arb

from robot_dyn.compiled.program import Kind, Program
from robot_dyn.errors import ProofError

Function = Callable[..., Sequence[Any]]

_LINES = {
    Kind.ADD: "{0} + {1}",
    Kind.SUBTRACT: "{0} - {1}",
    Kind.MULTIPLY: "{0} * {1}",
    Kind.DIVIDE: "{0} / {1}",
    Kind.NEGATE: "-{0}",
    Kind.SQUARE: "{0} * {0}",
    Kind.TWICE: "{0} + {0}",
    Kind.RECIPROCAL: "1 / {0}",
    Kind.SQUARE_ROOT: "{0}.sqrt()",
    Kind.EXPONENTIAL: "{0}.exp()",
    Kind.SINE_COSINE: "{0}.sin_cos()",
    Kind.HYPERBOLIC_TANGENT: "tanh({0})",
}
_MOST = 16.0  # of a constant that CasADi makes: exact halves, far from a rounded decimal


def straight_line(program: Program) -> Function:
    """The function of a sequence of all inputs, one after the other, balls or series of balls.

    Raises:
        ProofError: If a constant may have been rounded, or an instruction is not analytic.
    """
    for x in program.constants:
        if not (abs(x) <= _MOST and float(2 * x).is_integer()):
            raise ProofError(f"the trace folded a constant in float64, {x!r}: no theorem could say which number it is")
    first, count = sum(program.inputs), len(program.constants)
    lines = ["def function(x, tanh, constants):"]
    if first:
        lines.append(f" {_list(range(first))} = x")
    if count:
        lines.append(f" {_list(range(first, first + count))} = constants")
    for op in program.ops:
        if op.kind not in _LINES:
            raise ProofError(f"{op.kind.name.lower()} is not analytic: no theorem is proven across it")
        lines.append(f" {_list(op.made).rstrip(',')} = {_LINES[op.kind].format(*(f'v{i}' for i in op.of))}")
    lines.append(f" return {_list(program.outputs)}")
    scope: dict[str, Any] = {}
    exec("\n".join(lines), scope)  # of numbers only
    function = scope["function"]

    def of_inputs(x: Sequence[Any]) -> Sequence[Any]:
        return function(x, _tanh, [arb(each) for each in program.constants])

    return of_inputs


def _tanh(x: Any) -> Any:
    """Tanh x = 1 − 2 / (1 + e²ˣ), of a series; of a ball its own."""
    return x.tanh() if hasattr(x, "tanh") else 1 - 2 / (1 + (x + x).exp())


def _list(values: Sequence[int] | range) -> str:
    return ", ".join(f"v{i}" for i in values) + ("," if len(values) == 1 else "")
