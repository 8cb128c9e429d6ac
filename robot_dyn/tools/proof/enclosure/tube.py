"""The tube: a set p(t) + B that the true motion cannot leave within a step.

    e' = J e − (0, d),  J ∈ J(p + B),   |e(t)| ≤ e^{ht L} (|e₀| + h |d|)   with  L ≥ μ(J) on p + B

in the norm |e| = maxᵢ |eᵢ| / wᵢ, B = {|e| ≤ s}; μ is the logarithmic norm. If the right side is less than s, the motion
exists, is unique and stays inside, by continuation. [Hairer, Nørsett, Wanner 1993, I.10; Lohner 1987]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from flint import arb, ctx

from robot_dyn.tools.proof.enclosure.balls import Ball, Inverse, Matrix, NotProvenError, between, largest, upper
from robot_dyn.tools.proof.enclosure.linearised import on_a_set
from robot_dyn.tools.proof.enclosure.polynomial import Defect, Polynomial
from robot_dyn.tools.proof.tape import Tape

_PARTS = 4  # number of parts of a step
_WIDER = 3  # times the initial bound of e
_GUESS = 8  # times the expected difference of accelerations
_MOST = 0.7  # h L: above this, the fundamental matrix is poorly known


@final
@dataclass(frozen=True)
class Tube:
    """A tube around the polynomial of a step.

    Attributes:
        weights: Weights w, exact, (2n,).
        size: Size s, with |eᵢ| ≤ s wᵢ for all i.
        growth: Bound of e^{hL}.
        local: Bound of h e^{hL} |d|.
        B: Balls |bᵢ| ≤ s wᵢ, (2n,).
        C: Balls that contain a − p'' on the tube, (n,).
    """

    weights: tuple[Ball, ...]
    size: Ball
    growth: Ball
    local: Ball
    B: tuple[Ball, ...]
    C: tuple[Ball, ...]


def tube(
    tape: Tape, time: Ball, p: Polynomial, inverse: Inverse, h: Ball, of: Defect, start: Sequence[Ball],
    weights: Sequence[Ball], rate: float,
) -> Tube:  # fmt: skip
    """Return the tube of a step.

    Args:
        tape: Tape of the motion.
        time: Time at the start of the step.
        p: The polynomial.
        inverse: Approximate inverse of M.
        h: The step.
        of: Defect of the polynomial.
        start: Bounds of |e| at the start, (2n,).
        weights: Weights w, exact and positive, (2n,).
        rate: Rate σ at the start, with |J| w ≤ σ w.

    Raises:
        NotProvenError: If the motion may leave the tube.
    """
    n = tape.n
    first = largest(e / w for e, w in zip(start, weights, strict=True))
    defect = largest(x / w for x, w in zip(of.d, weights[n:], strict=True))
    before = upper(first + h * defect)
    size = upper(_WIDER * before + arb(2) ** (-4 * ctx.prec))
    B = [arb(0, upper(size * w)) for w in weights]
    C = [arb(0, upper(_GUESS * (rate * size * w + d))) for w, d in zip(weights[n:], of.d, strict=True)]
    L = arb(0)
    for part in range(_PARTS):
        T = between((h * part / _PARTS).lower(), (h * (part + 1) / _PARTS).upper())
        bound = logarithmic_norm(on_a_set(tape, inverse, time + T, p.at(T), B, C, of.rho), weights)
        L = bound if bound > L else L
    if not h * L < _MOST:
        raise NotProvenError("a step is too long for the growth of errors within it")
    growth = upper((h * L).exp())
    if not growth * before < size:
        raise NotProvenError("the motion may leave the tube around its polynomial")
    return Tube(tuple(weights), size, growth, upper(growth * h * defect), tuple(B), tuple(C))


def logarithmic_norm(J: Matrix, w: Sequence[Ball]) -> Ball:
    """Return a bound of μ of [0 1; J] in the norm maxᵢ |eᵢ| / wᵢ: maxᵢ (Jᵢᵢ + Σ |Jᵢⱼ| wⱼ / wᵢ); at least 0."""
    n = J.nrows()
    most = largest(w[n + i] / w[i] for i in range(n))
    for i in range(n):
        row = sum((upper(J[i, j]) * w[j] for j in range(2 * n) if j != n + i), start=0 * w[0])
        bound = J[i, n + i] + row / w[n + i]
        if not bound.is_finite():
            raise NotProvenError("a ball is not finite: a divisor may be 0")
        most = bound.upper() if bound.upper() > most else most
    return most
