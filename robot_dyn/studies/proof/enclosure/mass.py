"""Solutions of M x = r for all matrices M of balls, by a matrix A close to M⁻¹ of one of them.

    x = A r + E x,  E = 1 − A M:   |x|ᵢ ≤ |A r|ᵢ + uᵢ ε/(1−ε) maxⱼ |A r|ⱼ / uⱼ   with  ε = ‖E‖ < 1

in the norm maxᵢ |xᵢ| / uᵢ, uᵢ = √Aᵢᵢ: in these units M has ones on its diagonal. [Rump 2010, sec. 10]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import final

from flint import arb

from robot_dyn.studies.proof.enclosure.balls import Ball, Matrix, NotProvenError, dot, largest, matrix, upper


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
        n, u, product = M.nrows(), self.units, self.A * M
        epsilon = largest(dot([upper(int(i == j) - product[i, j]) for j in range(n)], u) / u[i] for i in range(n))
        if not epsilon < 1:
            raise NotProvenError(
                "within a step M is not certainly regular: the set of states is too wide, or M nearly singular"
            )
        return upper(epsilon / (1 - epsilon))

    def bound(self, more: Ball, r: Sequence[Ball]) -> list[Ball]:
        """Exact bounds of |M⁻¹ x| for all |x| ≤ r, (n,), where ε/(1−ε) ≤ `more`."""
        n, u = len(r), self.units
        first = [dot([upper(self.A[i, j]) for j in range(n)], r) for i in range(n)]
        size = more * largest(x / w for x, w in zip(first, u, strict=True))
        return [upper(x + size * w) for x, w in zip(first, u, strict=True)]

    def solve(self, more: Ball, right: Matrix) -> Matrix:
        """M⁻¹ G for all matrices where ε/(1−ε) ≤ `more`, (n, k)."""
        product, u = self.A * right, self.units
        n, columns = product.nrows(), product.ncols()
        sizes = [more * largest(product[i, j] / u[i] for i in range(n)) for j in range(columns)]
        return matrix([[product[i, j] + arb(0, upper(sizes[j] * u[i])) for j in range(columns)] for i in range(n)])
