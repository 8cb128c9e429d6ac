"""Explicit methods: each stage needs only those before it.

    k_i = f(t + c_i h, y + h Σ_{j<i} a_ij k_j),    y⁺ = y + h Σ_i b_i k_i

[Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.1–II.5]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from typing import NamedTuple, final

from robot_dyn.foundations.arithmetic import Arithmetic, Array, Scalar
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.values import aligned
from robot_dyn.integrate import dop853_coefficients as table
from robot_dyn.integrate.integrator import FixedStepper, PlainMethod, RightSide, States
from robot_dyn.integrate.primitives import combination, evaluate
from robot_dyn.integrate.tableau import ButcherTableau, Coefficients


class Stages(NamedTuple):
    """The stages K_j of a step, (s, r, W)."""

    K: Array


def explicit_step(f: RightSide, tableau: Coefficients, work: Stages, t: Scalar, h: Scalar, x: States) -> int:
    """Take a step of an explicit Runge–Kutta method; see `FixedStepper` for the arguments."""
    y, after, p, run_parameters, K, s = x.y, x.after, x.p, x.run_parameters, work.K, len(tableau.c)
    evaluate(f.rate, t, y, p, run_parameters, K[0])
    for i in range(1, s):
        combination(after, y, h, tableau.a[i], K, i)
        evaluate(f.rate, t + tableau.c[i] * h, after, p, run_parameters, K[i])
    combination(after, y, h, tableau.b, K, s)
    return s


@final
@dataclass(frozen=True)
class ExplicitRungeKutta(PlainMethod):
    """The explicit Runge–Kutta method of a tableau, in float, longdouble or balls.

    In balls the result encloses the exact result of the step, not the flow.

    Raises:
        QueryError: If a stage of the tableau needs itself or a later one.
    """

    name: str
    tableau: ButcherTableau
    order: int = field(init=False)
    evaluations_per_step: int | None = field(init=False)

    def __post_init__(self) -> None:
        if not self.tableau.explicit or float(self.tableau.c[0]) != 0:
            raise QueryError(f"{self.name}: row i of an explicit method's tableau, from 0, may have up to i entries")
        object.__setattr__(self, "order", self.tableau.order)
        object.__setattr__(self, "evaluations_per_step", len(self.tableau.b))

    def stepper(
        self, kind: Arithmetic, m: int, n: int, rows: int, runs: int = 1, widths: Array | None = None
    ) -> FixedStepper:
        K = aligned((len(self.tableau.b), rows, runs), kind.dtype)
        return FixedStepper(explicit_step, self.tableau.arrays(kind), Stages(K))


class Start(NamedTuple):
    """The coefficients of semi-implicit Euler: the number n of positions, and b₁ = 1."""

    n: int
    b: Array


def semi_implicit_step(f: RightSide, start: Start, work: Stages, t: Scalar, h: Scalar, x: States) -> int:
    """Take a step of semi-implicit Euler; see `FixedStepper` for the arguments."""
    n, y, after = start.n, x.y, x.after
    evaluate(f.rate, t, y, x.p, x.run_parameters, work.K[0])
    combination(after, y, h, start.b, work.K, 1)
    combination(after[:n], y[:n], h, start.b, after[n : 2 * n].reshape((1, n, y.shape[1])), 1)
    return 1


@final
@dataclass(frozen=True)
class SemiImplicitEuler(PlainMethod):
    """Euler's method with the new velocity in the position: v⁺ = v + h a(t, q, v), then q⁺ = q + h v⁺.

    The state must be y = (q, v, quadratures) with q' = v; quadratures advance with the explicit rate. The method is
    symplectic for a constant mass matrix and forces that do not depend on v, like the Störmer–Verlet method. It is not
    symplectic for robot arms, because M depends on q, and (q, v) are not canonical coordinates.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., 2006, I.1.2 and VI.3.
    """

    name: str = "SemiImplicitEuler"
    order: int = field(default=1, init=False)
    evaluations_per_step: int | None = field(default=1, init=False)

    def stepper(
        self, kind: Arithmetic, m: int, n: int, rows: int, runs: int = 1, widths: Array | None = None
    ) -> FixedStepper:
        return FixedStepper(semi_implicit_step, Start(n, kind.array([1])), Stages(aligned((1, rows, runs), kind.dtype)))


_HALF, _THIRD, _SIXTH = Fraction(1, 2), Fraction(1, 3), Fraction(1, 6)

# Euler, 1768: q⁺ = q + h v, v⁺ = v + h a
EULER = ExplicitRungeKutta("Euler", ButcherTableau(a=((),), b=(1,), c=(0,), order=1))

# Runge, 1895. HNW I, II.1, (1.4)
MIDPOINT = ExplicitRungeKutta("Midpoint", ButcherTableau(a=((), (_HALF,)), b=(0, 1), c=(0, _HALF), order=2))

# Kutta, 1901. HNW I, table II.1.2
RK4 = ExplicitRungeKutta(
    "RK4",
    ButcherTableau(
        a=((), (_HALF,), (0, _HALF), (0, 0, 1)),
        b=(_SIXTH, _THIRD, _THIRD, _SIXTH),
        c=(0, _HALF, _HALF, 1),
        order=4,
    ),
)


@cache
def dp8() -> ExplicitRungeKutta:
    """Return the method of order 8 with 12 stages of Dormand and Prince, at a fixed step.

    The coefficients are rounded to float64. In longdouble they limit the accuracy of a step to about 1e-16 h.

    Source: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.5 and II.10.
    """
    a = tuple(tuple(map(float, row[:i])) for i, row in enumerate(table.A[: table.STAGES]))
    b, c = (tuple(map(float, x[: table.STAGES])) for x in (table.B, table.C))
    return ExplicitRungeKutta("DP8", ButcherTableau(a, b, c, order=8))
