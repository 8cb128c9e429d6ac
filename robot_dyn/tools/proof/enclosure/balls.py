"""Bounds of balls and of matrices of balls; a value that is not finite ends a proof instead of passing a comparison.

Solutions of M x = r for all matrices M in balls, from a matrix A close to M⁻¹ of one of them:

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
from typing import final

from flint import arb, arb_mat, ctx, fmpq

Ball = arb
Matrix = arb_mat

_GUARD = 24  # bits; with 100 bits this still fits two words


class NotProvenError(Exception):
    """Internal: a bound does not hold, or a step is too long for it; the message gives the reason."""


@contextmanager
def finer() -> Iterator[None]:
    """Use more bits where numbers cancel: in a residual, otherwise only the rounding of its terms would remain."""
    with ctx.workprec(ctx.prec + _GUARD):
        yield


def upper(x: Ball) -> Ball:
    """Return an exact upper bound of |x|."""
    if not x.is_finite():
        raise NotProvenError("a ball is not finite: a divisor may be 0")
    return x.abs_upper()


def largest(balls: Iterable[Ball]) -> Ball:
    """Return an exact upper bound of all |x|."""
    return max(map(upper, balls))


def dot(x: Sequence[Ball], y: Sequence[Ball]) -> Ball:
    """Return Σ xᵢ yᵢ."""
    total = x[0] * y[0]
    for a, b in zip(x[1:], y[1:], strict=True):
        total = total + a * b
    return total


def horner(coefficients: Sequence[Ball], x: Ball) -> Ball:
    """Return Σ cₖ xᵏ."""
    total = coefficients[-1]
    for c in coefficients[-2::-1]:
        total = total * x + c
    return total


def exact(x: Fraction) -> Ball:
    """Return a fraction whose denominator is a power of two, as an exact number."""
    with ctx.workprec(x.numerator.bit_length() + 2):
        result = arb(fmpq(x.numerator, x.denominator))
    assert result.is_exact()
    return result


def between(low: Ball, high: Ball) -> Ball:
    """Return a ball that contains the interval between two exact numbers."""
    return low.union(high)


def matrix(rows: Sequence[Sequence[Ball]]) -> Matrix:
    """Return the matrix of these rows."""
    return arb_mat([list(row) for row in rows])


def identity(n: int) -> Matrix:
    """Return the unit matrix, (n, n)."""
    return matrix([[arb(int(i == j)) for j in range(n)] for i in range(n)])


def absolute_product(A: Matrix, x: Sequence[Ball]) -> list[Ball]:
    """Return balls of Σⱼ |Aᵢⱼ| xⱼ, from exact bounds of |Aᵢⱼ|."""
    return [dot([upper(A[i, j]) for j in range(A.ncols())], x) for i in range(A.nrows())]


def norm(A: Matrix, w: Sequence[Ball]) -> Ball:
    """Return a bound of ‖A‖ in the norm maxᵢ |xᵢ| / wᵢ."""
    return largest(x / unit for x, unit in zip(absolute_product(A, w), w, strict=True))


@final
@dataclass(frozen=True)
class Inverse:
    """A matrix close to M⁻¹.

    Attributes:
        A: Exact matrix, (n, n).
    """

    A: Matrix

    @classmethod
    def from_matrix(cls, M: Sequence[Ball]) -> Inverse:
        """Return an approximate inverse of the midpoints of M, n² numbers row by row."""
        n = round(sqrt(len(M)))
        try:
            return cls(matrix([M[i * n : (i + 1) * n] for i in range(n)]).mid().inv().mid())
        except ZeroDivisionError:
            raise NotProvenError("M may be singular") from None

    @cached_property
    def units(self) -> list[Ball]:
        """Units u of the norm, exact and positive."""
        diagonal = [float(self.A[i, i]) for i in range(self.A.nrows())]
        if not all(x > 0 for x in diagonal):
            raise NotProvenError("M may be singular")
        return [arb(sqrt(x)) for x in diagonal]

    def contraction(self, M: Matrix) -> Ball:
        """Return ε/(1−ε) for all matrices in the balls of M.

        Raises:
            NotProvenError: If ε is not less than 1, because one of them may be singular.
        """
        epsilon = norm(identity(M.nrows()) - self.A * M, self.units)
        if not epsilon < 1:
            raise NotProvenError("M may be singular within a step: the set of states is too wide, or M nearly singular")
        return upper(epsilon / (1 - epsilon))

    def bound(self, more: Ball, r: Sequence[Ball]) -> list[Ball]:
        """Return exact bounds of |M⁻¹ x| for all |x| ≤ r, (n,), where ε/(1−ε) ≤ `more`."""
        first, u = absolute_product(self.A, r), self.units
        size = more * largest(x / w for x, w in zip(first, u, strict=True))
        return [upper(x + size * w) for x, w in zip(first, u, strict=True)]

    def solve(self, more: Ball, right: Matrix) -> Matrix:
        """Return M⁻¹ G for all matrices where ε/(1−ε) ≤ `more`, (n, k)."""
        product, u = self.A * right, self.units
        n, columns = product.nrows(), product.ncols()
        sizes = [more * largest(product[i, j] / u[i] for i in range(n)) for j in range(columns)]
        return matrix([[product[i, j] + arb(0, upper(sizes[j] * u[i])) for j in range(columns)] for i in range(n)])
