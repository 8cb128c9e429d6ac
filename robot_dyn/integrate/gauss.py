"""Gauss–Legendre collocation: implicit Runge–Kutta methods of s stages and order 2 s, symmetric and symplectic.

    k_i = f(t + c_i h, y + h Σ_j a_ij k_j),    y⁺ = y + h Σ_i b_i k_i,    Pₛ(2 c_i − 1) = 0

They keep every quadratic invariant, and the energy of a Hamiltonian system in (q, p) up to a bounded O(h²ˢ).
[Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., 2006, II.1.3, IV.2.1 and VI.4]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, ClassVar, final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.errors import QueryError
from robot_dyn.integrate.fixed_point import MOST_ITERATIONS, enclose_fixed_point, fixed_point
from robot_dyn.integrate.integrator import IntegrationError, Integrator, System
from robot_dyn.integrate.tableau import ButcherTableau, Surd, combine
from robot_dyn.validate import integer


def _surd(rational: tuple[int, int], factor: tuple[int, int], radicand: int) -> Surd:
    return Surd(Fraction(*rational), Fraction(*factor), radicand)


_TABLEAUS = {
    # the implicit midpoint rule
    2: ButcherTableau(a=((Fraction(1, 2),),), b=(1,), c=(Fraction(1, 2),), order=2),
    # Hammer and Hollingsworth, 1955. HLW, table II.1.1
    4: ButcherTableau(
        a=(
            (Fraction(1, 4), _surd((1, 4), (-1, 6), 3)),
            (_surd((1, 4), (1, 6), 3), Fraction(1, 4)),
        ),
        b=(Fraction(1, 2), Fraction(1, 2)),
        c=(_surd((1, 2), (-1, 6), 3), _surd((1, 2), (1, 6), 3)),
        order=4,
    ),
    # Kuntzmann and Butcher. HLW, table II.1.1
    6: ButcherTableau(
        a=(
            (Fraction(5, 36), _surd((2, 9), (-1, 15), 15), _surd((5, 36), (-1, 30), 15)),
            (_surd((5, 36), (1, 24), 15), Fraction(2, 9), _surd((5, 36), (-1, 24), 15)),
            (_surd((5, 36), (1, 30), 15), _surd((2, 9), (1, 15), 15), Fraction(5, 36)),
        ),
        b=(Fraction(5, 18), Fraction(4, 9), Fraction(5, 18)),
        c=(_surd((1, 2), (-1, 10), 15), Fraction(1, 2), _surd((1, 2), (1, 10), 15)),
        order=6,
    ),
}


@final
@dataclass(frozen=True)
class Gauss(Integrator):
    """Gauss–Legendre collocation of order 2, 4 or 6, its stages solved by fixed-point iteration until rounding ends it.

    The iteration converges where h is small against the fastest motion, h L ‖A‖ < 1 with L the Lipschitz constant of f,
    and may take MOST_ITERATIONS (100) rounds: the method is A-stable, but this solution of its stages is not for stiff
    systems. In balls the step holds an exact solution of the stage equations, proven by Brouwer's theorem.

    Attributes:
        order: 2, 4 or 6.

    Raises:
        QueryError: If the order is another.
    """

    order: int
    name: str = field(init=False)
    evaluations_per_step: int | None = field(default=None, init=False)
    canonical: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if integer("order", self.order) not in _TABLEAUS:
            raise QueryError(f"no Gauss method of order {self.order!r}: give 2, 4 or 6")
        object.__setattr__(self, "name", f"gauss_{self.order}")

    @property
    def tableau(self) -> ButcherTableau:
        """Its coefficients."""
        return _TABLEAUS[self.order]

    def step(self, system: System, t: Any, y: Array, h: Any) -> Array:
        kind, a, b, c = self.tableau.numbers(y)
        h = kind.number(h)
        times = [t + node * h for node in c]

        def update(x: Array) -> Array:
            """The increments h k_i of all stages, shape (s, ..., m), from those of the round before."""
            return np.stack([system.rate(at, y + combine(row, x)) * h for at, row in zip(times, a, strict=True)])

        with np.errstate(over="ignore", invalid="ignore"):  # a diverging iteration is reported below
            x = fixed_point(update, kind.array(np.zeros((len(c), *y.shape))), y)
            if x is not None and y.dtype == object:
                x = enclose_fixed_point(update, x)
        if x is None:
            raise IntegrationError(
                f"{self.name}: the stages of the step {float(h)} at t = {float(t)} do not converge in "
                f"{MOST_ITERATIONS} iterations: take a smaller step, or a method for stiff systems",
                t,
            )
        return y + combine(b, x)
