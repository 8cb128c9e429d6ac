"""The Jacobian of f(t, q, v) = (v, a) on sets, J = [0 1; ∂a/∂q ∂a/∂v], from derivatives of inverse dynamics.

    M ∂a/∂x = −∂R/∂x (t, x, a),   x = (q, v)

as matrices of balls, or as power series of them, order by order: M₀ Jₖ = −Gₖ − Σ Mᵢ Jₖ₋ᵢ. On a set x = p(t) + b the
acceleration is a = p'' + c with M c = −R(t, x, p'') = −ρ − ∂R/∂x b: c is small, and needs no forward dynamics.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from robot_dyn.tools.proof.enclosure.balls import (
    Ball,
    Inverse,
    Matrix,
    NotProvenError,
    absolute_product,
    matrix,
    upper,
)
from robot_dyn.tools.proof.enclosure.polynomial import coefficient
from robot_dyn.tools.proof.tape import Tape


def jacobian(tape: Tape, inverse: Inverse, arguments: Sequence[Any], length: int = 1) -> list[Matrix]:
    """Return ∂a/∂(q, v), (n, 2n), as series of a length.

    Args:
        tape: Tape of the motion.
        inverse: Approximate inverse of M.
        arguments: t, q, v, a: balls, or series of the length.
        length: Number of coefficients; 1 for balls.

    Raises:
        NotProvenError: If M may be singular.
    """
    parts = _parts(tape, arguments, length)
    more = inverse.contraction(parts[0][1])
    coefficients: list[Matrix] = []
    for k, (right, _) in enumerate(parts):
        for i in range(1, k + 1):
            right = right + parts[i][1] * coefficients[k - i]
        coefficients.append(-inverse.solve(more, right))
    return coefficients


def on_a_set(
    tape: Tape, inverse: Inverse, t: Ball, p: tuple[list[Ball], list[Ball], list[Ball]], B: Sequence[Ball],
    C: Sequence[Ball], rho: Sequence[Ball],
) -> Matrix:  # fmt: skip
    """Return ∂a/∂(q, v) for all (q, v) in p(t) + B, (n, 2n).

    Args:
        tape: Tape of the motion.
        inverse: Approximate inverse of M.
        t: Times, a ball.
        p: Position, velocity and acceleration of the polynomial at these times.
        B: Balls around 0, (2n,).
        C: Balls around 0 that should contain a − p'', (n,).
        rho: Bounds of the residual along the polynomial at these times, (n,).

    Raises:
        NotProvenError: If C may not contain a − p'' everywhere, or M may be singular.
    """
    n = tape.n
    q, v, a = (
        [x + b for x, b in zip(centre, wide, strict=True)] for centre, wide in zip(p, (B[:n], B[n:], C), strict=True)
    )
    ((right, M),) = _parts(tape, (t, q, v, a), 1)
    more = inverse.contraction(M)
    J = -inverse.solve(more, right)
    spread = absolute_product(J, [upper(b) for b in B])
    for c, d, x in zip(C, inverse.bound(more, rho), spread, strict=True):
        if not d + x < c.upper():
            raise NotProvenError("accelerations within the tube are not bounded: the set of states is too wide")
    return J


def _parts(tape: Tape, arguments: Sequence[Any], length: int) -> list[tuple[Matrix, Matrix]]:
    """Return ∂R/∂(q, v), (n, 2n), and M, (n, n), of each order."""
    n, coefficients = tape.n, tape.derivatives(*arguments)
    parts = []
    for k in range(length):
        rows = [[coefficient(x, k) for x in coefficients[3 * n * i : 3 * n * (i + 1)]] for i in range(n)]
        parts.append((matrix([row[: 2 * n] for row in rows]), matrix([row[2 * n :] for row in rows])))
    return parts
