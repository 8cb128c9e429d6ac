"""Bounds of balls and of matrices of balls; what is not finite ends a proof instead of passing a comparison.

Solutions of M x = r for all matrices M of balls, by a matrix A close to M⁻¹ of one of them:

    x = A r + E x,  E = 1 − A M:   |x|ᵢ ≤ |A r|ᵢ + uᵢ ε/(1−ε) maxⱼ |A r|ⱼ / uⱼ   with  ε = ‖E‖ < 1

in the norm maxᵢ |xᵢ| / uᵢ, uᵢ = √Aᵢᵢ: in these units M has ones on its diagonal. [Rump 2010, sec. 10]
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import sqrt
from typing import Any, final

from flint import arb, arb_mat, ctx, fmpq

Ball = Any  # flint.arb
Matrix = Any  # flint.arb_mat

_GUARD = 24  # with 100 bits no more than two words


class NotProvenError(Exception):
    """Internal: a bound does not hold, or a step is too long for it; says why."""


@contextmanager
def finer() -> Iterator[None]:
    """More bits, where numbers cancel: of a residual those of its terms would be left otherwise."""
    with ctx.workprec(ctx.prec + _GUARD):
        yield


def upper(x: Ball) -> Ball:
    """An exact number that |x| does not exceed."""
    if not x.is_finite():
        raise NotProvenError("a ball is not finite: a divisor may be 0")
    return x.abs_upper()


def largest(balls: Iterable[Ball]) -> Ball:
    """An exact number that none of |x| exceeds."""
    most = None
    for x in balls:
        bound = upper(x)
        most = bound if most is None or bound > most else most
    return most


def dot(x: Sequence[Ball], y: Sequence[Ball]) -> Ball:
    """Σ xᵢ yᵢ."""
    total = x[0] * y[0]
    for a, b in zip(x[1:], y[1:], strict=True):
        total = total + a * b
    return total


def horner(coefficients: Sequence[Ball], x: Ball) -> Ball:
    """Σ cₖ xᵏ."""
    total = coefficients[-1]
    for c in coefficients[-2::-1]:
        total = total * x + c
    return total


def exact(x: Fraction) -> Ball:
    """A fraction with a power of two below it, as a number without radius."""
    with ctx.workprec(x.numerator.bit_length() + 2):
        made = arb(fmpq(x.numerator, x.denominator))
    assert made.is_exact()
    return made


def between(low: Ball, high: Ball) -> Ball:
    """A ball that holds the interval between two exact numbers."""
    return low.union(high)


def matrix(rows: Sequence[Sequence[Ball]]) -> Matrix:
    """The matrix of its rows."""
    return arb_mat([list(row) for row in rows])


def identity(n: int) -> Matrix:
    """The unit matrix, (n, n)."""
    return matrix([[arb(int(i == j)) for j in range(n)] for i in range(n)])


def absolute_product(A: Matrix, x: Sequence[Ball]) -> list[Ball]:
    """Balls of Σⱼ |Aᵢⱼ| xⱼ, of exact bounds of |Aᵢⱼ|."""
    return [dot([upper(A[i, j]) for j in range(A.ncols())], x) for i in range(A.nrows())]


def norm(A: Matrix, w: Sequence[Ball]) -> Ball:
    """A bound of ‖A‖ in the norm maxᵢ |xᵢ| / wᵢ."""
    return largest(x / unit for x, unit in zip(absolute_product(A, w), w, strict=True))


@final
@dataclass(frozen=True)
class Inverse:
    """A matrix close to M⁻¹.

    Attributes:
        A: Exact, (n, n).
    """

    A: Matrix

    @classmethod
    def of(cls, M: Sequence[Ball]) -> Inverse:
        """Of the midpoints of M, n² numbers row by row."""
        n = round(sqrt(len(M)))
        try:
            return cls(matrix([M[i * n : (i + 1) * n] for i in range(n)]).mid().inv().mid())
        except ZeroDivisionError:
            raise NotProvenError("M may be singular") from None

    @cached_property
    def units(self) -> list[Ball]:
        """u, exact and positive."""
        made = [float(self.A[i, i]) for i in range(self.A.nrows())]
        if not all(x > 0 for x in made):
            raise NotProvenError("M may be singular")
        return [arb(sqrt(x)) for x in made]

    def contraction(self, M: Matrix) -> Ball:
        """ε/(1−ε) for all matrices that the balls of M hold.

        Raises:
            NotProvenError: If ε is not less than 1: then one of them may be singular.
        """
        epsilon = norm(identity(M.nrows()) - self.A * M, self.units)
        if not epsilon < 1:
            raise NotProvenError(
                "within a step M is not certainly regular: the set of states is too wide, or M nearly singular"
            )
        return upper(epsilon / (1 - epsilon))

    def bound(self, more: Ball, r: Sequence[Ball]) -> list[Ball]:
        """Exact bounds of |M⁻¹ x| for all |x| ≤ r, (n,), where ε/(1−ε) ≤ `more`."""
        first, u = absolute_product(self.A, r), self.units
        size = more * largest(x / w for x, w in zip(first, u, strict=True))
        return [upper(x + size * w) for x, w in zip(first, u, strict=True)]

    def solve(self, more: Ball, right: Matrix) -> Matrix:
        """M⁻¹ G for all matrices where ε/(1−ε) ≤ `more`, (n, k)."""
        product, u = self.A * right, self.units
        n, columns = product.nrows(), product.ncols()
        sizes = [more * largest(product[i, j] / u[i] for i in range(n)) for j in range(columns)]
        return matrix([[product[i, j] + arb(0, upper(sizes[j] * u[i])) for j in range(columns)] for i in range(n)])
