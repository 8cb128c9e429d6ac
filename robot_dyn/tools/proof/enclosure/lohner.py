"""The error from step to step, e ∈ Q [−r, r], with a rotating Q: Lohner's method against the wrapping effect.

    e(h) ∈ Y(h) e(0) + w [−1, 1] (δ |e(0)| + h e^{hL} |d|),    δ = h e^{hL} ‖Y' − J Y‖

Y is a polynomial close to the fundamental matrix: Yₖ₊₁ = Σ Jᵢ Yₖ₋ᵢ / (k + 1). Q' is orthonormal in units of the
weights, by Householder's QR of Y Q diag(r), longest columns first. [Lohner 1987; Nedialkov, Jackson, Corliss 1999]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from flint import arb, arb_mat, ctx

from robot_dyn.tools.proof.enclosure.balls import (
    Ball,
    Inverse,
    Matrix,
    NotProvenError,
    absolute_product,
    identity,
    largest,
    matrix,
    norm,
    upper,
)
from robot_dyn.tools.proof.enclosure.linearised import jacobian
from robot_dyn.tools.proof.enclosure.polynomial import Polynomial, series
from robot_dyn.tools.proof.enclosure.tube import Tube
from robot_dyn.tools.proof.tape import Tape

_ORDERS = 3, 6  # orders of Y: the second if the error of the first exceeds _ENOUGH
_ENOUGH = 1e-3
_DOUBT = 0.05  # largest δ


@final
@dataclass(frozen=True)
class ErrorSet:
    """The set Q [−r, r].

    Attributes:
        Q: Exact matrix, (m, m).
        r: Exact numbers, not negative, (m,).
    """

    Q: Matrix
    r: tuple[Ball, ...]

    @property
    def bounds(self) -> list[Ball]:
        """Bounds of each |eᵢ|."""
        return [upper(x) for x in absolute_product(self.Q, self.r)]


def box(r: Sequence[Ball]) -> ErrorSet:
    """Return the set |eᵢ| ≤ rᵢ."""
    return ErrorSet(identity(len(r)), tuple(r))


def fundamental(
    tape: Tape, time: Ball, p: Polynomial, everywhere: Polynomial, inverse: Inverse, h: Ball, T: Ball, within: Tube
) -> tuple[Matrix, Ball]:  # fmt: skip
    """Return Y(h) and δ on a tube; `everywhere` is p expanded about T.

    Raises:
        NotProvenError: If δ is too large.
    """
    Y, delta = [identity(2 * tape.n)], arb("inf")
    for order in _ORDERS:
        J = [
            *_coefficients(tape, time, p, inverse, within, order)[:order],
            _coefficients(tape, time + T, everywhere, inverse, within, order)[order],
        ]
        Y, delta = _expansion(J, h, within)
        if delta < _ENOUGH:
            break
    if not delta < _DOUBT:
        raise NotProvenError("the fundamental matrix is too uncertain: the start is too wide, or a step too long")
    at_end = Y[-1]
    for term in Y[-2::-1]:
        at_end = at_end * h + term
    return at_end, delta


def _coefficients(
    tape: Tape, time: Ball, p: Polynomial, inverse: Inverse, within: Tube, order: int
) -> list[Matrix]:  # fmt: skip
    """Return the coefficients of J(p + b) for all b in a tube, up to the order."""
    n, length = tape.n, order + 1
    ctx.cap = length
    sets = within.B[:n], within.B[n:], within.C
    x = (
        [series([c[0] + b, *c[1:]], length) for c, b in zip(coefficients, wide, strict=True)]
        for coefficients, wide in zip((p.q, p.v, p.a), sets, strict=True)
    )
    J = jacobian(tape, inverse, (series([time, arb(1)], length), *x), length)
    return [_whole(term, k == 0) for k, term in enumerate(J)]


def _expansion(J: Sequence[Matrix], h: Ball, within: Tube) -> tuple[list[Matrix], Ball]:
    """Return Y of order m from the m + 1 coefficients of J, and δ."""
    m, size = len(J) - 1, J[0].nrows()
    Y = [identity(size)]
    for k in range(m):
        total = sum((J[i] * Y[k - i] for i in range(1, k + 1)), start=J[0] * Y[k])
        Y.append((total * (arb(1) / (k + 1))).mid())
    delta, power = arb(0), arb(1)
    for k in range(2 * m + 1):
        defect = Y[k + 1] * arb(k + 1) if k < m else arb_mat(size, size)
        for i in range(max(0, k - m), min(k, m) + 1):
            defect = defect - J[i] * Y[k - i]
        delta, power = delta + norm(defect, within.weights) * power, power * h
    return Y, upper(h * within.growth * delta)


def carried(before: ErrorSet, Y: Matrix, delta: Ball, within: Tube, rounding: Sequence[Ball]) -> ErrorSet:
    """Return the error set at the end of a step, for centres rounded by `rounding`, (m,)."""
    w = within.weights
    size = largest(e / x for e, x in zip(before.bounds, w, strict=True))
    local = [upper(x * (delta * size + within.local) + e) for x, e in zip(w, rounding, strict=True)]
    YQ = Y * before.Q
    Q = _turned(YQ, before.r, w)
    try:
        inverse = Q.inv()
    except ZeroDivisionError:
        raise NotProvenError("the frame of the error set is singular") from None
    Z = inverse * YQ
    parts = zip(absolute_product(Z, before.r), absolute_product(inverse, local), strict=True)
    return ErrorSet(Q, tuple(upper(x + y) for x, y in parts))


def _turned(YQ: Matrix, r: Sequence[Ball], w: Sequence[Ball]) -> Matrix:
    """Return Q', exact: any matrix is valid, and this one keeps the set narrow."""
    m, most = len(r), largest(r)
    units = np.array([float(x) for x in w])
    sizes = np.array([float(x / most) if most > 0 else 0.0 for x in r])
    columns = np.array([[float(YQ[i, j].mid()) for j in range(m)] for i in range(m)]) / units[:, None] * sizes
    if not np.isfinite(columns).all():
        raise NotProvenError("the error set is too wide")
    order = np.argsort(-np.linalg.norm(columns, axis=0), kind="stable")
    Q = np.linalg.qr(columns[:, order])[0] * units[:, None]
    return matrix([[arb(float(x)) for x in row] for row in Q])


def _whole(J: Matrix, constant: bool) -> Matrix:
    """Return [0 1; J] for a coefficient of a power series, whose identity is only in the constant one."""
    n = J.nrows()
    top = [[arb(int(constant and j == n + i)) for j in range(2 * n)] for i in range(n)]
    return matrix([*top, *([J[i, j] for j in range(2 * n)] for i in range(n))])
