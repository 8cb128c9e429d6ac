"""A verified solution of M x = b in balls, M symmetric positive definite: approximate inverse, residual, enclosure.

    |x − x̃| ≤ w / (1 − α)   where   w ≥ |R (b − M x̃)|,   |I − R M| w ≤ α w,  α < 1,   R ≈ mid(M)⁻¹,  x̃ ≈ R mid(b)

Elimination in balls widens them by 5 to 6 bits a row; here the balls of M and b are multiplied once, and R and x̃ are
exact numbers of more bits. As mid(M) is positive definite and no matrix of the ball is singular, all symmetric ones in
it are positive definite. [Rump, Verification methods, Acta Numerica 19, 2010, sec. 10]
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Balls = Any  # numpy.ndarray of flint.arb


def verified_solve(M: Balls, b: Balls, solve: Callable[[Balls, Balls], Balls | None]) -> Balls | None:
    """The solution x (n,) of one system in the working precision, or None where M is not certainly positive definite.

    Args:
        M: Shape (n, n); its upper triangle counts.
        b: Shape (n,).
        solve: (M, B) → M⁻¹ Bᵀ, a row for each of B, of exact balls in more bits; None if M is not positive definite.
    """
    from flint import arb, ctx

    n, bits = len(b), ctx.prec
    identity = np.array([[arb(int(i == j)) for j in range(n)] for i in range(n)], dtype=object)
    with ctx.workprec(2 * bits + 8 * n + 64):  # elimination of mid(M) loses less than half of it
        M = np.where(np.triu(np.ones((n, n), dtype=bool)), M, M.T)
        inverse = solve(_each(M, "mid"), identity)
        if inverse is None:
            return None
        R = _each(inverse, "mid")
        x = _each(R @ _each(b, "mid"), "mid")
        w = _each(np.abs(R @ (b - M @ x)), "upper")
        w = w + (max(w) + max(np.abs(x)) + arb(2) ** -bits) * arb(2) ** (-2 * bits)  # positive, and hardly more
        alpha = max(_each(np.abs(identity - R @ M) @ w / w, "upper"))
        if not alpha < 1:
            return None
        radius = _each(w / (1 - alpha), "upper")
        x = np.array([arb(middle, r) for middle, r in zip(x, radius, strict=True)], dtype=object)
    return x + arb(0)  # rounded to the working precision


def _each(x: Balls, name: str) -> Balls:
    """The midpoint, or upper bound, of each ball, exactly."""
    from flint import arb

    return np.vectorize(lambda ball: getattr(arb(ball), name)(), otypes=[object])(x)
