"""The defect of a polynomial: d = p'' − M⁻¹ (τ − C p' − N) = M(p)⁻¹ ρ, bounded over a step.

    ρ(t) = R(t, p, p', p'') = Σₖ ρₖ tᵏ + ρ_{N+1}(ξ) t^{N+1},  ξ ∈ [0, h]

The last coefficient is that of the series about the whole interval: Lagrange's remainder. q' = v holds exactly.
[Neher, Jackson, Nedialkov 2007]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from flint import arb, ctx

from robot_dyn.studies.proof.enclosure.balls import Ball, dot, finer, matrix, upper
from robot_dyn.studies.proof.enclosure.mass import Inverse
from robot_dyn.studies.proof.enclosure.polynomial import Polynomial, coefficient, series
from robot_dyn.studies.proof.tape.tape import Tape


@final
@dataclass(frozen=True)
class Defect:
    """Bounds on a step, exact.

    Attributes:
        rho: Of |ρ|, (n,).
        d: Of |d|, (n,).
        rounding: What |d| would be without the remainder, (n,): no shorter step makes it less.
    """

    rho: list[Ball]
    d: list[Ball]
    rounding: list[Ball]


def defect(
    tape: Tape, time: Ball, p: Polynomial, everywhere: Polynomial, inverse: Inverse, h: Ball, T: Ball, order: int
) -> Defect:  # fmt: skip
    """The defect on a step.

    Args:
        tape: Of the motion.
        time: At the start of the step, exact.
        p: The polynomial from there.
        everywhere: The same about T.
        inverse: Close to M⁻¹.
        h: The step, exact.
        T: A ball that holds [0, h].
        order: Of the accelerations of the polynomial.
    """
    n = tape.n
    start, whole = _residual(tape, time, p, order + 1), _residual(tape, time + T, everywhere, order + 2)
    powers = [h**k for k in range(order + 2)]
    rounding, rho = [], []
    for at_start, anywhere in zip(start, whole, strict=True):
        known = [upper(coefficient(at_start, k)) for k in range(order + 1)]
        rounding.append(upper(dot(known, powers[:-1])))
        rho.append(upper(rounding[-1] + upper(coefficient(anywhere, order + 1)) * powers[-1]))
    M = tape.mass([each[0] for each in everywhere.q])
    more = inverse.contraction(matrix([M[i * n : (i + 1) * n] for i in range(n)]))
    return Defect(rho, inverse.bound(more, rho), inverse.bound(more, rounding))


def _residual(tape: Tape, time: Ball, p: Polynomial, length: int) -> list[Ball]:
    """R along a polynomial, as series of a length."""
    ctx.cap = length
    given = ([series(each, length) for each in known] for known in (p.q, p.v, p.a))
    with finer():
        return list(tape.residual(series([time, arb(1)], length), *given))
