"""The Taylor polynomial of a motion, exact numbers close to q(t) = Σ qₖ tᵏ, and its defect.

    R(t, p, p', p'') = O(t^{N+1}):   order by order, aₖ = −M(q₀)⁻¹ ρₖ with ρₖ at aₖ = 0

The coefficients need not be exact: the defect bounds the residual in the equation of motion,

    d = p'' − M⁻¹ (τ − C p' − N) = M(p)⁻¹ ρ,   ρ(t) = R(t, p, p', p'') = Σₖ ρₖ tᵏ + ρ_{N+1}(ξ) t^{N+1},  ξ ∈ [0, h]

The last coefficient is that of the series about the whole interval: Lagrange's remainder. q' = v holds exactly.
[Neher, Jackson, Nedialkov 2007]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

from flint import arb, arb_series, ctx

from robot_dyn.tools.proof.enclosure.balls import Ball, Inverse, dot, finer, horner, matrix, upper
from robot_dyn.tools.proof.tape import Tape

Coefficients = tuple[tuple[Ball, ...], ...]  # ascending, for each joint


@final
@dataclass(frozen=True)
class Polynomial:
    """A polynomial q(t) with exact coefficients, t from the start of a step.

    Attributes:
        q: Coefficients of the positions.
    """

    q: Coefficients

    @cached_property
    def v(self) -> Coefficients:
        """Coefficients of the velocities."""
        return derivatives(self.q)

    @cached_property
    def a(self) -> Coefficients:
        """Coefficients of the accelerations."""
        return derivatives(self.v)

    def at(self, t: Ball) -> tuple[list[Ball], list[Ball], list[Ball]]:
        """Return balls that contain position, velocity and acceleration for every t of a ball."""
        q, v, a = ([horner(c, t) for c in coefficients] for coefficients in (self.q, self.v, self.a))
        return q, v, a

    def about(self, t: Ball) -> Polynomial:
        """Return the polynomial q(t + τ) in τ for every t of a ball, with balls as coefficients."""
        shifted = []
        for own in self.q:  # repeated synthetic division
            c = list(own)
            for i in range(len(c) - 1):
                for j in range(len(c) - 2, i - 1, -1):
                    c[j] = c[j] + t * c[j + 1]
            shifted.append(tuple(c))
        return Polynomial(tuple(shifted))


def derivatives(coefficients: Coefficients) -> Coefficients:
    """Return the coefficients of the derivatives."""
    with finer():  # keeps exact coefficients exact
        return tuple(tuple(k * c for k, c in enumerate(own) if k) for own in coefficients)


def series(coefficients: Sequence[Ball], length: int) -> Any:
    """Return a power series that is known up to the coefficient before `length`."""
    return arb_series(list(coefficients[:length]), length)


def coefficient(x: arb | arb_series, k: int) -> Ball:
    """Return a coefficient of a power series, or of a number."""
    if isinstance(x, arb):
        return x if k == 0 else arb(0)
    return x[k]


def taylor(tape: Tape, time: Ball, q: Sequence[Ball], v: Sequence[Ball], inverse: Inverse, order: int) -> Polynomial:
    """Return the polynomial from an exact state, with accelerations up to the order."""
    qs, vs, as_ = [[x, y] for x, y in zip(q, v, strict=True)], [[x] for x in v], [[] for _ in q]
    for k in range(order + 1):
        ctx.cap = k + 1
        t = series([time, arb(1)], k + 1)
        arguments = (qs, vs, [[*a, arb(0)] for a in as_])
        with finer():
            rho = tape.residual(t, *([series(c, k + 1) for c in argument] for argument in arguments))
        a = inverse.A * matrix([[coefficient(x, k).mid()] for x in rho])
        for i in range(len(q)):
            as_[i].append(-a[i, 0].mid())
            vs[i].append((as_[i][-1] / (k + 1)).mid())
            qs[i].append((vs[i][-1] / (k + 2)).mid())
    return Polynomial(tuple(map(tuple, qs)))


@final
@dataclass(frozen=True)
class Defect:
    """Exact bounds on a step.

    Attributes:
        rho: Bounds of |ρ|, (n,).
        d: Bounds of |d|, (n,).
        rounding: Bounds of |d| without the remainder, (n,), which a shorter step does not reduce.
    """

    rho: list[Ball]
    d: list[Ball]
    rounding: list[Ball]


def defect(
    tape: Tape, time: Ball, p: Polynomial, everywhere: Polynomial, inverse: Inverse, h: Ball, T: Ball, order: int
) -> Defect:  # fmt: skip
    """Return the defect on a step.

    Args:
        tape: Tape of the motion.
        time: Start of the step, exact.
        p: Polynomial from the start.
        everywhere: The same polynomial about T.
        inverse: Approximate inverse of M.
        h: Length of the step, exact.
        T: Ball that contains [0, h].
        order: Order of the accelerations of the polynomial.
    """
    n = tape.n
    start, whole = _residual(tape, time, p, order + 1), _residual(tape, time + T, everywhere, order + 2)
    powers = [h**k for k in range(order + 2)]
    rounding, rho = [], []
    for at_start, anywhere in zip(start, whole, strict=True):
        terms = [upper(coefficient(at_start, k)) for k in range(order + 1)]
        rounding.append(upper(dot(terms, powers[:-1])))
        rho.append(upper(rounding[-1] + upper(coefficient(anywhere, order + 1)) * powers[-1]))
    M = tape.mass([coefficients[0] for coefficients in everywhere.q])
    more = inverse.contraction(matrix([M[i * n : (i + 1) * n] for i in range(n)]))
    return Defect(rho, inverse.bound(more, rho), inverse.bound(more, rounding))


def _residual(tape: Tape, time: Ball, p: Polynomial, length: int) -> list[Ball]:
    """Return R along a polynomial, as series of a length."""
    ctx.cap = length
    arguments = ([series(own, length) for own in coefficients] for coefficients in (p.q, p.v, p.a))
    with finer():
        return list(tape.residual(series([time, arb(1)], length), *arguments))
