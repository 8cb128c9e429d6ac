"""The numbers the equations run in: float32, float64, longdouble, or balls with a proven radius.

Every formulation is written once with NumPy's operators; an `Arithmetic` makes its own numbers of the literals a file
states, and the functions below hide what NumPy does not do for every kind of number. A ball is an interval
midpoint ± radius that is certain to hold the exact value [Johansson, Arb, 2017].
"""

from __future__ import annotations

import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import wraps
from threading import RLock
from typing import Any, final

import numpy as np

from robot_dyn.errors import QueryError, shown
from robot_dyn.validate import integer, real
from robot_dyn.verified_solve import verified_solve

Array = Any  # numpy.ndarray of floats, or of flint.arb objects; NumPy's own types do not tell them apart


class Arithmetic(ABC):
    """A kind of number.

    Attributes:
        dtype: Of the arrays that hold these numbers.
    """

    dtype: np.dtype

    @abstractmethod
    def number(self, literal: Any) -> Any:
        """One number from the text of a file, or from a number, which is taken exactly."""

    @abstractmethod
    def scope(self) -> AbstractContextManager[None]:
        """The context in which operations have this arithmetic's precision."""

    @abstractmethod
    def asarray(self, values: Any) -> Array:
        """Array of numbers; TypeError or ValueError if one is not a number. Not copied if of this kind already."""

    @abstractmethod
    def finite(self, x: Array) -> np.ndarray:
        """Which entries are finite numbers."""

    def array(self, literals: Any) -> Array:
        """Array of numbers, of the shape of the nested literals."""
        source = np.asarray(literals, dtype=object)
        result = np.empty(source.size, dtype=self.dtype)
        result[:] = [self.number(literal) for literal in source.flat]
        return result.reshape(source.shape)


@final
@dataclass(frozen=True)
class Float(Arithmetic):
    """Floating-point numbers of one NumPy dtype, rounded to nearest."""

    dtype: np.dtype

    def number(self, literal: Any) -> Any:
        return self.dtype.type(literal)

    def scope(self) -> AbstractContextManager[None]:
        return nullcontext()

    def asarray(self, values: Any) -> Array:
        array = real(values)
        with np.errstate(over="ignore"):  # a longdouble may be too large: then it is not finite
            return array.astype(self.dtype, copy=False)

    def finite(self, x: Array) -> np.ndarray:
        return np.isfinite(x)


FLOAT64 = Float(np.dtype(np.float64))

MOST_BITS = 1_000_000  # of a ball: a product of such takes milliseconds

# flint keeps one working precision for the whole process, so balls of two precisions must take turns.
_flint_turn = RLock()


@final
@dataclass(frozen=True)
class Ball(Arithmetic):
    """Balls (flint.arb) with midpoints of `bits` bits: every result encloses the exact value.

    Attributes:
        bits: Precision of the midpoints, from 2 to a million, 53 for that of float64.
    """

    bits: int = 53
    dtype: np.dtype = field(default_factory=lambda: np.dtype(object), init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "bits", integer("bits of a Ball", self.bits, least=2, most=MOST_BITS))

    def number(self, literal: Any) -> Any:
        from flint import arb

        if literal.__class__ is np.longdouble:
            high = float(literal)  # two exact parts, each a float64
            return arb(high) + arb(float(literal - np.longdouble(high)))
        exact = (arb, str, int)
        return arb(literal if isinstance(literal, exact) else float(literal))

    @contextmanager
    def scope(self) -> Iterator[None]:
        from flint import ctx

        with _flint_turn, ctx.workprec(self.bits):
            yield

    def asarray(self, values: Any) -> Array:
        array = np.asarray(values, dtype=object) if not isinstance(values, np.ma.MaskedArray) else real(values)
        if any(isinstance(x, bool | np.bool_) for x in array.flat):
            raise ValueError("truth values")
        return self.array(array)

    def finite(self, x: Array) -> np.ndarray:
        return np.vectorize(lambda ball: ball.is_finite(), otypes=[bool])(x)


def arithmetic_of(dtype: Any) -> Arithmetic:
    """The arithmetic that a user names: a float dtype of NumPy, or an `Arithmetic` such as `Ball(200)`.

    Raises:
        QueryError: If it is neither.
    """
    if isinstance(dtype, Arithmetic):
        return dtype
    try:
        found = np.dtype(dtype)
    except Exception:  # whatever a foreign object makes of it
        found = None
    if dtype is None or found is None or found.kind != "f" or found.itemsize < 4:
        raise QueryError(f"no arithmetic {shown(dtype)}: give float32, float64, np.longdouble or Ball(bits)")
    return Float(found)


def in_arithmetic(method: Callable[..., Any]) -> Callable[..., Any]:
    """Run a method in the precision of its object's `arithmetic`."""

    @wraps(method)
    def scoped(self: Any, *args: Any, **options: Any) -> Any:
        with self.arithmetic.scope():
            return method(self, *args, **options)

    return scoped


def midpoint(x: Array) -> Array:
    """The float64 nearest to the midpoint of each ball."""
    return _of_each(x, lambda ball: float(ball.mid()))


def radius(x: Array) -> Array:
    """A float64 upper bound of the radius of each ball."""
    return _of_each(x, lambda ball: float(ball.rad().upper()))


def _of_each(x: Any, of: Callable[[Any], float]) -> Array:
    from flint import arb

    balls = np.asarray(x, dtype=object)
    if not all(isinstance(ball, arb) for ball in balls.flat):
        raise QueryError(f"give an array of balls, such as rd.Lagrangian(robot, rd.Ball(200)) answers, got {shown(x)}")
    return np.vectorize(of, otypes=[float])(balls)


# NumPy applies these to object arrays by calling the method of the same name on each entry, so one name serves all.
sin, cos, sqrt, tanh = np.sin, np.cos, np.sqrt, np.tanh


def positive_part(x: Array) -> Array:
    """max(x, 0), exactly; of balls (x + |x|) / 2, for the larger of two that overlap is not known."""
    if type(x) is np.ndarray and x.dtype == object:
        return (x + np.abs(x)) / 2
    return np.maximum(x, 0.0)


def transpose(x: Array) -> Array:
    """Transpose of the last two axes."""
    return np.swapaxes(x, -1, -2)


def apply(A: Array, x: Array) -> Array:
    """A x for A (..., m, n) and x (..., n)."""
    return (A @ x[..., None])[..., 0]


def symmetric(A: Array) -> Array:
    """A (..., m, m), symmetric but for rounding, with its upper triangle in place of the lower: less to trace.

    Floats are left as they are, for speed.
    """
    if A.dtype != object:
        return A
    upper = np.triu(np.ones(A.shape[-2:], dtype=bool))
    return np.where(upper, A, transpose(A))


_SWEEPS = 8  # of Jacobi's method: it converges quadratically, six rows in six sweeps


def eigh(A: Array) -> tuple[Array, Array]:
    """Eigenvalues (..., m) and orthonormal eigenvectors (..., m, m) of symmetric A; by LAPACK for float64, ascending.

    For other numbers by Jacobi's cyclic method with a fixed number of sweeps, so that it can be traced; in no order.

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
    """Cosine and sine of the smaller angle that makes a symmetric 2 × 2 matrix diagonal."""
    d, b = arr - app, 2 * apr
    size = np.abs(d) + sqrt(d * d + b * b)
    t = np.where(d < 0, -1, 1) * b / np.where(size > 0, size, 1)
    c = 1 / sqrt(1 + t * t)
    return c, t * c


def _turned(x: Array, y: Array, c: Array, s: Array) -> tuple[Array, Array]:
    return c * x - s * y, s * x + c * y


class NotPositiveDefiniteError(Exception):
    """Internal: a pivot of a factorisation is not positive; the caller names the joint of `row`.

    `decided` says whether that is certain, or its sign is lost in rounding.
    """

    def __init__(self, row: int, decided: bool) -> None:
        super().__init__(f"pivot {row} is not positive")
        self.row, self.decided = row, decided


def rounding(x: Array) -> str:
    """What numbers of an array are rounded to, in words."""
    if x.dtype.kind == "f":
        return x.dtype.name
    from flint import ctx

    return f"balls of {ctx.prec} bits"


def _lapack_solve(M: Array, b: Array) -> Array | None:
    """The same by LAPACK, for speed; None where a pivot is in doubt."""
    try:
        pivots = np.linalg.cholesky(M).diagonal(axis1=-2, axis2=-1) ** 2
    except np.linalg.LinAlgError:
        return None
    least = 4 * M.shape[-1] * np.finfo(np.float64).eps
    if not (pivots > least * M.diagonal(axis1=-2, axis2=-1)).all():
        return None
    return np.linalg.solve(M, b[..., None])[..., 0]


judging_regularity: ContextVar[bool] = ContextVar("judging_regularity", default=False)  # a trace assumes that it is


def _is_regular(pivot: Array, least: Array, whole: Array) -> bool:
    token = judging_regularity.set(True)
    try:
        return bool(np.all((pivot > least) & (whole > 0)))
    finally:
        judging_regularity.reset(token)


def cholesky_solve(M: Array, b: Array) -> Array:
    """Solve M x = b for symmetric positive definite M by its factorisation L D Lᵀ; balls by a verified solution.

    Args:
        M: Shape (..., n, n).
        b: Shape (..., n).

    Returns:
        The solution, shape (..., n).

    Raises:
        NotPositiveDefiniteError: If a pivot is not certain to be positive: for floats, 4 n ε of the diagonal at least;
            for balls, positive throughout. Tells the row.

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

    return any(isinstance(each, arb) for each in x.flat)


def _verified_solves(M: Array, b: Array) -> Array | None:
    """The same of balls, without the loss of digits by elimination; None where a pivot is in doubt."""

    def solve(M: Array, B: Array) -> Array | None:
        try:
            return _eliminate(M[None], B)
        except NotPositiveDefiniteError:
            return None

    n = M.shape[-1]
    batch = np.broadcast_shapes(M.shape[:-2], b.shape[:-1])
    x, rows = np.empty((*batch, n), dtype=object), np.broadcast_to(b, (*batch, n))
    for k in np.ndindex(batch):
        one = verified_solve(np.broadcast_to(M, (*batch, n, n))[k], rows[k], solve)
        if one is None:
            return None
        x[k] = one
    return x


def _not_positive_definite(M: Array, row: int, pivot: Array) -> NotPositiveDefiniteError:
    """The error of a pivot that may not be positive; of floats only an M_ii ≤ 0, of whatever row, makes it certain.

    The rounding of M itself may turn the sign of a pivot.
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
