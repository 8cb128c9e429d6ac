"""Explicit methods: each stage needs only those before it.

    k_i = f(t + c_i h, y + h Σ_{j<i} a_ij k_j),    y⁺ = y + h Σ_i b_i k_i

[Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.1–II.5]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from typing import Any, final

from robot_dyn.arithmetic import Array
from robot_dyn.errors import QueryError
from robot_dyn.integrate.integrator import Integrator, System, arithmetic_like
from robot_dyn.integrate.tableau import ButcherTableau, combine


@final
@dataclass(frozen=True)
class ExplicitRungeKutta(Integrator):
    """The explicit Runge–Kutta method of a tableau, in float, longdouble or balls.

    In balls it encloses the exact result of the step, not the flow.

    Raises:
        QueryError: If a stage of the tableau needs itself or a later one.
    """

    name: str
    tableau: ButcherTableau
    order: int = field(init=False)
    evaluations_per_step: int | None = field(init=False)

    def __post_init__(self) -> None:
        if not self.tableau.explicit:
            raise QueryError(f"{self.name}: a tableau of an explicit method has i entries at most in row i")
        object.__setattr__(self, "order", self.tableau.order)
        object.__setattr__(self, "evaluations_per_step", len(self.tableau.b))

    def step(self, system: System, t: Any, y: Array, h: Any) -> Array:
        kind, a, b, c = self.tableau.numbers(y)
        h = kind.number(h)
        k: list[Array] = []
        for row, node in zip(a, c, strict=True):
            k.append(system.rate(t + node * h, y + combine(row, k) * h if row else y))
        return y + combine(b, k) * h


@final
@dataclass(frozen=True)
class SemiImplicitEuler(Integrator):
    """Euler's method with the new velocity in the position: v⁺ = v + h a(t, q, v), then q⁺ = q + h v⁺.

    Needs y = (q, v, quadratures) with q' = v; quadratures advance with the explicit rate. It is symplectic for a
    constant mass matrix and forces that do not depend on v (Störmer and Verlet's relative) and is NOT symplectic here:
    the M of a robot arm depends on q, and (q, v) are not canonical coordinates.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., 2006, I.1.2 and VI.3.
    """

    name: str = "semi_implicit_euler"
    order: int = field(default=1, init=False)
    evaluations_per_step: int | None = field(default=1, init=False)

    def step(self, system: System, t: Any, y: Array, h: Any) -> Array:
        n, h = system.n, arithmetic_like(y).number(h)
        after = y + system.rate(t, y) * h
        after[..., :n] = y[..., :n] + after[..., n : 2 * n] * h
        return after


_HALF, _THIRD, _SIXTH = Fraction(1, 2), Fraction(1, 3), Fraction(1, 6)

# deck 001: q⁺ = q + v dt, v⁺ = v + a dt. Euler, 1768.
EXPLICIT_EULER = ExplicitRungeKutta("explicit_euler", ButcherTableau(a=((),), b=(1,), c=(0,), order=1))

# Runge, 1895. HNW I, II.1, (1.4)
MIDPOINT = ExplicitRungeKutta("midpoint", ButcherTableau(a=((), (_HALF,)), b=(0, 1), c=(0, _HALF), order=2))

# Kutta, 1901. HNW I, table II.1.2
RK4 = ExplicitRungeKutta(
    "rk4",
    ButcherTableau(
        a=((), (_HALF,), (0, _HALF), (0, 0, 1)),
        b=(_SIXTH, _THIRD, _THIRD, _SIXTH),
        c=(0, _HALF, _HALF, 1),
        order=4,
    ),
)


@cache
def order_8() -> ExplicitRungeKutta:
    """The method of order 8 with 12 stages of Dormand and Prince, at a fixed step; also `explicit.ORDER_8`.

    Its coefficients are SciPy's, rounded to float64: in longdouble they bound the accuracy of a step to some 1e-16 h.

    Source: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.5 and II.10.
    """
    from scipy.integrate import DOP853

    a = tuple(tuple(map(float, row[:i])) for i, row in enumerate(DOP853.A))
    return ExplicitRungeKutta(
        "order_8", ButcherTableau(a, tuple(map(float, DOP853.B)), tuple(map(float, DOP853.C)), order=8)
    )


def __getattr__(name: str) -> Any:
    if name == "ORDER_8":  # made when asked for: SciPy is slow to import
        return order_8()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
