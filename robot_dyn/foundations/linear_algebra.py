"""Linear algebra in any arithmetic: eigenvalues of symmetric matrices, and M x = b for positive definite M.

Floats are solved by L D Lᵀ; for balls, a solution is verified: approximate inverse, residual, enclosure.

    |x − x̃| ≤ w / (1 − α)   where   w ≥ |R (b − M x̃)|,   |I − R M| w ≤ α w,  α < 1,   R ≈ mid(M)⁻¹,  x̃ ≈ R mid(b)

Elimination in balls would widen them by 5 to 6 bits per row; here the balls of M and b are multiplied once, and R and x̃
are exact numbers with more bits. mid(M) is positive definite and no matrix in the ball is singular, so all symmetric
matrices in the ball are positive definite. [Rump, Verification methods, Acta Numerica 19, 2010, sec. 10]
"""

from __future__ import annotations

import sys
from contextvars import ContextVar

import numpy as np

from robot_dyn.foundations.arithmetic import Array, sqrt
from robot_dyn.foundations.errors import PortableError

_SWEEPS = 8  # Jacobi's method converges quadratically, for six rows in six sweeps


def eigh(A: Array) -> tuple[Array, Array]:
    """Compute eigenvalues (..., m) and orthonormal eigenvectors (..., m, m) of symmetric A.

    For float64, LAPACK returns them in ascending order. For other numbers, Jacobi's cyclic method returns them in no
    particular order; its fixed number of sweeps allows tracing.

    Source: Golub and Van Loan, Matrix Computations, 4th ed., 2013, sec. 8.5.
    """
    if A.dtype == np.float64:
        return np.linalg.eigh(A)
    m = A.shape[-1]
    A, U = A.copy(), np.broadcast_to(np.eye(m, dtype=A.dtype), A.shape).copy()
    for _ in range(_SWEEPS):
        for p in range(m - 1):
            for r in range(p + 1, m):
                c, s = _rotation(A[..., p, p, None], A[..., p, r, None], A[..., r, r, None])
                for X in (A, U):  # X ← X J, columns p and r
                    X[..., p], X[..., r] = _turned(X[..., p], X[..., r], c, s)
                A[..., p, :], A[..., r, :] = _turned(A[..., p, :], A[..., r, :], c, s)
                A[..., p, r] = A[..., r, p] = 0 * A[..., p, r]
    return np.diagonal(A, axis1=-2, axis2=-1), U


def _rotation(app: Array, apr: Array, arr: Array) -> tuple[Array, Array]:
    """Return cosine and sine of the smaller angle that diagonalises a symmetric 2 × 2 matrix."""
    d, b = arr - app, 2 * apr
    size = np.abs(d) + sqrt(d * d + b * b)
    t = np.where(d < 0, -1, 1) * b / np.where(size > 0, size, 1)
    c = 1 / sqrt(1 + t * t)
    return c, t * c


def _turned(x: Array, y: Array, c: Array, s: Array) -> tuple[Array, Array]:
    return c * x - s * y, s * x + c * y


class NotPositiveDefiniteError(PortableError):
    """Internal error: a pivot of a factorisation is not positive; callers map `row` to a joint.

    `decided` is False if rounding hides the sign of the pivot.
    """

    def __init__(self, row: int, decided: bool) -> None:
        super().__init__(f"pivot {row} is not positive")
        self.row, self.decided = row, decided


def _lapack_solve(M: Array, b: Array) -> Array | None:
    """Solve M x = b by LAPACK, for speed; return None if a pivot may not be positive."""
    try:
        pivots = np.linalg.cholesky(M).diagonal(axis1=-2, axis2=-1) ** 2
    except np.linalg.LinAlgError:
        return None
    least = 4 * M.shape[-1] * np.finfo(np.float64).eps
    if not (pivots > least * M.diagonal(axis1=-2, axis2=-1)).all():
        return None
    return np.linalg.solve(M, b[..., None])[..., 0]


in_regularity_check: ContextVar[bool] = ContextVar("in_regularity_check", default=False)  # tracing assumes regularity


def _is_regular(pivot: Array, least: Array, whole: Array) -> bool:
    token = in_regularity_check.set(True)
    try:
        return bool(np.all((pivot > least) & (whole > 0)))
    finally:
        in_regularity_check.reset(token)


def cholesky_solve(M: Array, b: Array) -> Array:
    """Solve M x = b for symmetric positive definite M by its factorisation L D Lᵀ; balls by a verified solution.

    Args:
        M: Shape (..., n, n).
        b: Shape (..., n).

    Returns:
        The solution, shape (..., n).

    Raises:
        NotPositiveDefiniteError: If a pivot is not certainly positive: for floats, if it is at most 4 n ε times the
            diagonal entry; for balls, if it contains numbers that are not positive.

    Source: Golub and Van Loan, Matrix Computations, 4th ed., 2013, alg. 4.1.2.
    """
    if M.dtype == b.dtype == np.float64 and (x := _lapack_solve(M, b)) is not None:
        return x
    if _are_balls(M) and (x := _verified_solves(M, b)) is not None:
        return x
    return _eliminate(M, b)


def _are_balls(x: Array) -> bool:
    if x.dtype != object or "flint" not in sys.modules:
        return False
    from flint import arb

    return any(isinstance(entry, arb) for entry in x.flat)


def _verified_solves(M: Array, b: Array) -> Array | None:
    """Solve M x = b for balls without elimination, which loses digits; return None if M may be singular."""
    n = M.shape[-1]
    batch = np.broadcast_shapes(M.shape[:-2], b.shape[:-1])
    matrices, rows = np.broadcast_to(M, (*batch, n, n)), np.broadcast_to(b, (*batch, n))
    x = np.empty((*batch, n), dtype=object)
    for k in np.ndindex(batch):
        solution = _verified_solve(matrices[k], rows[k])
        if solution is None:
            return None
        x[k] = solution
    return x


def _verified_solve(M: Array, b: Array) -> Array | None:
    """Solve one system, (n,), in the working precision; return None if M is not certainly positive definite.

    Args:
        M: Shape (n, n); only the upper triangle is read.
        b: Shape (n,).
    """
    from flint import arb, ctx

    n, bits = len(b), ctx.prec
    identity = np.array([[arb(int(i == j)) for j in range(n)] for i in range(n)], dtype=object)
    with ctx.workprec(2 * bits + 8 * n + 64):  # elimination of mid(M) loses less than half of these bits
        M = np.where(np.triu(np.ones((n, n), dtype=bool)), M, M.T)
        try:
            inverse = _eliminate(_each(M, "mid")[None], identity)
        except NotPositiveDefiniteError:
            return None
        R = _each(inverse, "mid")
        x = _each(R @ _each(b, "mid"), "mid")
        w = _each(np.abs(R @ (b - M @ x)), "upper")
        w = w + (max(w) + max(np.abs(x)) + arb(2) ** -bits) * arb(2) ** (-2 * bits)  # makes w positive
        alpha = max(_each(np.abs(identity - R @ M) @ w / w, "upper"))
        if not alpha < 1:
            return None
        radius = _each(w / (1 - alpha), "upper")
        x = np.array([arb(middle, r) for middle, r in zip(x, radius, strict=True)], dtype=object)
    return x + arb(0)  # rounded to the working precision


def _each(x: Array, name: str) -> Array:
    """Return the midpoint, or upper bound, of each ball, exactly."""
    from flint import arb

    return np.vectorize(lambda ball: getattr(arb(ball), name)(), otypes=[object])(x)


def _not_positive_definite(M: Array, row: int, pivot: Array) -> NotPositiveDefiniteError:
    """Return the error for a pivot that may not be positive.

    For floats, the sign is certain only if some M_ii ≤ 0, because rounding of M may change the sign of a pivot.
    """
    n = M.shape[-1]
    if len(rows := np.flatnonzero(np.any(np.diagonal(M, axis1=-2, axis2=-1).reshape(-1, n) <= 0, axis=0))):
        return NotPositiveDefiniteError(int(rows[0]), decided=True)
    return NotPositiveDefiniteError(row, decided=M.dtype.kind != "f" and bool(np.any(pivot <= 0)))


def _eliminate(M: Array, b: Array) -> Array:
    """Solve M x = b by L D Lᵀ, in any arithmetic."""
    n = M.shape[-1]
    least = 4 * n * np.finfo(M.dtype).eps if M.dtype.kind == "f" else 0
    L, x = M.copy(), b.copy()  # unit lower triangle of L, and the pivots D on its diagonal
    for j in range(n):
        LD = L[..., j, :j] * np.diagonal(L, axis1=-2, axis2=-1)[..., :j]
        L[..., j, j] = L[..., j, j] - (L[..., j, :j] * LD).sum(axis=-1)
        pivot, whole = L[..., j, j], M[..., j, j]
        if not _is_regular(pivot, least * whole, whole):
            raise _not_positive_definite(M, j, pivot)
        below = L[..., j + 1 :, j] - (L[..., j + 1 :, :j] * LD[..., None, :]).sum(axis=-1)
        L[..., j + 1 :, j] = below / L[..., j, j, None]
        x[..., j] = x[..., j] - (L[..., j, :j] * x[..., :j]).sum(axis=-1)
    x = x / np.diagonal(L, axis1=-2, axis2=-1)
    for j in reversed(range(n)):
        x[..., j] = x[..., j] - (L[..., j + 1 :, j] * x[..., j + 1 :]).sum(axis=-1)
    return x
