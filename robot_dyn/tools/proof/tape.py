"""The tape of a motion: R(t, q, v, a) = M a + C v + N − τ, its derivatives by q, v and a, and M, in balls.

It is traced from the library's own recursions, with literals as balls: one more arithmetic for the same code. CasADi
computes the derivatives, which are trusted; tests compare them with power series. A traced program runs in the
arithmetic of balls, or of truncated power series of balls [Johansson 2017].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import add, methodcaller, mul, neg, sub, truediv
from typing import Any, Protocol, TypeVar, final

import casadi as ca
from flint import arb, ctx

from robot_dyn.codegen import Kind, Program, program_of
from robot_dyn.foundations import ProofError
from robot_dyn.lagrange import composite_body
from robot_dyn.tools.proof.motion import Bodies, Motion
from robot_dyn.tools.proof.term import Literals, expressions

Number = TypeVar("Number")  # a ball, or a truncated power series of balls; results have the type of arguments


class Function(Protocol):
    """A function of balls, or of truncated power series of balls."""

    def __call__(self, x: Sequence[Number], /) -> Sequence[Number]: ...


@final
class Tape:
    """Functions of a motion; numbers are balls, or truncated power series of balls.

    Args:
        motion: The motion.
        piece: A time in [s] on the piece of the reference to use.

    Attributes:
        n: Number of joints.
        programs: Programs of residual, mass matrix and derivatives.
    """

    def __init__(self, motion: Motion, piece: float = 0.0) -> None:
        arithmetic, self.n = Literals(), motion.robot.n
        with arithmetic.scope():
            functions = _traced(motion, arithmetic, piece)
            self._constants = list(arithmetic.constants.balls)
            self.programs: dict[str, Program] = {
                name: program_of(ca.Function(name, [*arguments, ca.vertcat(*arithmetic.constants.symbols)], [result]))
                for name, (arguments, result) in functions.items()
            }
        self._functions = {name: straight_line(program) for name, program in self.programs.items()}
        self._rounded: dict[int, list[Any]] = {}

    def residual(self, t: Number, q: Sequence[Number], v: Sequence[Number], a: Sequence[Number]) -> Sequence[Number]:
        """Return R(t, q, v, a), n numbers, 0 for the true motion."""
        return self._of("residual", [*q, *v, *a, t])

    def mass(self, q: Sequence[Number]) -> Sequence[Number]:
        """Return M(q), n² numbers row by row."""
        return self._of("mass", q)

    def derivatives(self, t: Number, q: Sequence[Number], v: Sequence[Number], a: Sequence[Number]) -> Sequence[Number]:
        """Return ∂R/∂(q, v, a), 3 n² numbers row by row; the last n columns are M."""
        return self._of("derivatives", [*q, *v, *a, t])

    def _of(self, name: str, x: Sequence[Any]) -> Sequence[Any]:
        if ctx.prec not in self._rounded:  # balls of fewer bits that contain the constants
            self._rounded[ctx.prec] = [+constant for constant in self._constants]
        return self._functions[name]([*x, *self._rounded[ctx.prec]])


def _traced(motion: Motion, arithmetic: Literals, piece: float) -> dict[str, tuple[list[Any], Any]]:
    """Return arguments and result of each function."""
    n, bodies = motion.robot.n, Bodies(motion.robot, arithmetic)
    (q, qs), (v, vs), (a, as_), (t, ts) = (
        arithmetic.inputs(name, size) for name, size in (("q", n), ("v", n), ("a", n), ("t", 1))
    )
    tau = motion.torque(bodies, ts, qs, vs, piece)
    M = composite_body(bodies.linkage, qs)
    residual = ca.cse(expressions(bodies.inverse_dynamics(qs, vs, as_) - tau))
    derivatives = ca.densify(ca.jacobian(residual, ca.vertcat(q, v, a)))
    return {
        "residual": ([q, v, a, t], residual),
        "mass": ([q], ca.cse(expressions(M))),
        "derivatives": ([q, v, a, t], ca.cse(ca.vec(derivatives.T))),
    }


_MOST = 16.0  # bound of constants from CasADi: exact halves, unlike rounded decimals


def _tanh(x: Any) -> Any:
    """Return tanh x = 1 − 2 / (1 + e²ˣ) of a series; for a ball the method of Arb."""
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
    """Return the function of a sequence of all inputs in order, balls or series of balls.

    Raises:
        ProofError: If a constant may have been rounded, or an instruction is not analytic.
    """
    for x in program.constants:
        if not (abs(x) <= _MOST and float(2 * x).is_integer()):
            raise ProofError(
                f"the trace folded the constant {x!r} in float64, so its exact value is lost; write it as a literal"
            )
    for op in program.ops:
        if op.kind not in _OPERATIONS:
            raise ProofError(f"{op.kind.name.lower()} is not analytic; remove the effect or controller that uses it")
    steps = [(_OPERATIONS[op.kind], op.operands, op.results) for op in program.ops]
    constants = [arb(constant) for constant in program.constants]
    count = 1 + max([sum(program.inputs) + len(constants) - 1, *(i for op in program.ops for i in op.results)])

    def function(x: Sequence[Any]) -> Sequence[Any]:
        values = [*x, *constants]
        values += [None] * (count - len(values))
        for operation, operands, results in steps:
            result = operation(*(values[i] for i in operands))
            if len(results) == 1:
                values[results[0]] = result
            else:
                values[results[0]], values[results[1]] = result
        return [values[i] for i in program.outputs]

    return function
