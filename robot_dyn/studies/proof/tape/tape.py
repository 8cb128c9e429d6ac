"""The tape of a motion: R(t, q, v, a) = M a + C v + N − τ, its derivatives by q, v and a, and M, in balls.

They are traced from the library's own recursions, with literals as balls: one more arithmetic over the same lines. The
derivatives are CasADi's of the trace, which are trusted, and are held to power series in the tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import casadi as ca
from flint import ctx

from robot_dyn.codegen.program import Program
from robot_dyn.codegen.trace.from_casadi import program_of
from robot_dyn.lagrange.recursions.composite_body import composite_body
from robot_dyn.studies.proof.motion import Bodies, Motion
from robot_dyn.studies.proof.tape.literals import Literals
from robot_dyn.studies.proof.tape.straight_line import straight_line
from robot_dyn.studies.proof.tape.term import expressions


@final
class Tape:
    """The functions of a motion; numbers are balls, or truncated power series of balls.

    Args:
        motion: What moves.
        piece: A time in [s] on the piece of the reference that counts.

    Attributes:
        n: Number of joints.
        programs: The instructions of residual, mass matrix and derivatives.
    """

    def __init__(self, motion: Motion, piece: float = 0.0) -> None:
        arithmetic, self.n = Literals(), motion.robot.n
        with arithmetic.scope():
            made = _traced(motion, arithmetic, piece)
            self._constants = list(arithmetic.constants.balls)
            self.programs: dict[str, Program] = {
                name: program_of(ca.Function(name, [*given, ca.vertcat(*arithmetic.constants.symbols)], [result]))
                for name, (given, result) in made.items()
            }
        self._functions = {name: straight_line(program) for name, program in self.programs.items()}
        self._rounded: dict[int, list[Any]] = {}

    def residual(self, t: Any, q: Sequence[Any], v: Sequence[Any], a: Sequence[Any]) -> Sequence[Any]:
        """R(t, q, v, a), n numbers, 0 for the true motion."""
        return self._of("residual", [*q, *v, *a, t])

    def mass(self, q: Sequence[Any]) -> Sequence[Any]:
        """M(q), n² numbers row by row."""
        return self._of("mass", q)

    def derivatives(self, t: Any, q: Sequence[Any], v: Sequence[Any], a: Sequence[Any]) -> Sequence[Any]:
        """∂R/∂(q, v, a), 3 n² numbers row by row; the last n columns are M."""
        return self._of("derivatives", [*q, *v, *a, t])

    def _of(self, name: str, x: Sequence[Any]) -> Sequence[Any]:
        if ctx.prec not in self._rounded:  # balls of fewer bits that hold the constants
            self._rounded[ctx.prec] = [+each for each in self._constants]
        return self._functions[name]([*x, *self._rounded[ctx.prec]])


def _traced(motion: Motion, arithmetic: Literals, piece: float) -> dict[str, tuple[list[Any], Any]]:
    """Arguments and result of each function."""
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
