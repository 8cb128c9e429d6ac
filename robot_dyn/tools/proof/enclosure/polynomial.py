"""The Taylor polynomial of a motion, exact numbers close to q(t) = Σ qₖ tᵏ, and its defect, by which it is off.

    R(t, p, p', p'') = O(t^{N+1}):   order by order, aₖ = −M(q₀)⁻¹ ρₖ with ρₖ that of aₖ = 0

Nothing of it need be right: by how much it fails the equation of motion is the defect,

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

Coefficients = tuple[tuple[Ball, ...], ...]  # of each joint, ascending


@final
@dataclass(frozen=True)
class Polynomial:
    """A polynomial q(t) of exact coefficients, t from the start of a step.

    Attributes:
        q: Its coefficients.
    """

    q: Coefficients

    @cached_property
    def v(self) -> Coefficients:
        """Those of its velocity."""
        return derivatives(self.q)

    @cached_property
    def a(self) -> Coefficients:
        """Those of its acceleration."""
        return derivatives(self.v)

    def at(self, t: Ball) -> tuple[list[Ball], list[Ball], list[Ball]]:
        """Balls that hold position, velocity and acceleration, for every t of a ball."""
        q, v, a = ([horner(each, t) for each in known] for known in (self.q, self.v, self.a))
        return q, v, a

    def about(self, t: Ball) -> Polynomial:
        """The polynomial of τ that q(t + τ) is, for every t of a ball: its coefficients are balls."""
        made = []
        for each in self.q:  # repeated synthetic division
            c = list(each)
            for i in range(len(c) - 1):
                for j in range(len(c) - 2, i - 1, -1):
                    c[j] = c[j] + t * c[j + 1]
            made.append(tuple(c))
        return Polynomial(tuple(made))


def derivatives(known: Coefficients) -> Coefficients:
    """Coefficients of the derivatives."""
    with finer():  # of exact coefficients exact
        return tuple(tuple(k * c for k, c in enumerate(each) if k) for each in known)


def series(coefficients: Sequence[Ball], length: int) -> Any:
    """A power series that is known to the coefficient before `length`."""
    return arb_series(list(coefficients[:length]), length)


def coefficient(x: Any, k: int) -> Ball:
    """A coefficient of a power series, or of a number."""
    if isinstance(x, arb):
        return x if k == 0 else arb(0)
    return x[k]


def taylor(tape: Tape, time: Ball, q: Sequence[Ball], v: Sequence[Ball], inverse: Inverse, order: int) -> Polynomial:
    """The polynomial from an exact state, with accelerations of the order."""
    qs, vs, as_ = [[x, y] for x, y in zip(q, v, strict=True)], [[x] for x in v], [[] for _ in q]
    for k in range(order + 1):
        ctx.cap = k + 1
        t = series([time, arb(1)], k + 1)
        given = (qs, vs, [[*a, arb(0)] for a in as_])
        with finer():
            rho = tape.residual(t, *([series(c, k + 1) for c in each] for each in given))
        a = inverse.A * matrix([[coefficient(x, k).mid()] for x in rho])
        for i in range(len(q)):
            as_[i].append(-a[i, 0].mid())
            vs[i].append((as_[i][-1] / (k + 1)).mid())
            qs[i].append((vs[i][-1] / (k + 2)).mid())
    return Polynomial(tuple(map(tuple, qs)))


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
