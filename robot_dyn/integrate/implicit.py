"""Implicit methods for stiff systems: L-stable, with the Jacobian J = ∂f/∂y in the step.

    (1 − h γ J) Δ = residual of a stage

The Jacobian is that of the system, or by differences, and the linear systems go to LAPACK: for float32 and float64.
[Hairer, Wanner, Solving Ordinary Differential Equations II, 2nd ed., 1996, IV.6 and IV.7]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, final

import numpy as np

from robot_dyn.foundations.arithmetic import Array, apply
from robot_dyn.foundations.errors import QueryError
from robot_dyn.integrate.fixed_point import MOST_ITERATIONS, fixed_point
from robot_dyn.integrate.integrator import IntegrationError, Integrator, System, arithmetic_like, singular
from robot_dyn.integrate.tableau import ButcherTableau, combine


@final
@dataclass(frozen=True)
class LinearlyImplicitEuler(Integrator):
    """Rosenbrock's method of one stage: y⁺ = y + h k with (1 − h J) k = f(t + h, y), J at (t + h, y).

    One step of Newton's method on the implicit Euler method, and equal to it where f is linear in y. L-stable. f at
    t + h rather than t: a stiff system then follows its forcing without a lag.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, 2nd ed., 1996, IV.7.
    """

    name: str = "linearly_implicit_euler"
    order: int = field(default=1, init=False)
    evaluations_per_step: int | None = field(default=None, init=False)  # 1 + 2 m
    stiff: ClassVar[bool] = True
    needs_jacobian: ClassVar[bool] = True

    def step(self, system: System, t: Any, y: Array, h: Any) -> Array:
        h = _step_of(self, y, h)
        W = np.eye(y.shape[-1], dtype=y.dtype) - h * system.jacobian(t + h, y)
        try:
            k = np.linalg.solve(W, system.rate(t + h, y)[..., None])[..., 0]
        except np.linalg.LinAlgError:
            raise singular(self, t, h) from None
        return y + h * k


@final
@dataclass(frozen=True)
class SinglyDiagonallyImplicit(Integrator):
    """The diagonally implicit Runge–Kutta method of a tableau with equal a_ii = γ, by simplified Newton iteration.

    All stages and rounds share one matrix, 1 − h γ J, with J at (t, y). The rounds continue until rounding ends them,
    MOST_ITERATIONS (100) at most.

    Raises:
        QueryError: If the tableau is not lower triangular with equal, positive diagonal.
    """

    name: str
    tableau: ButcherTableau
    order: int = field(init=False)
    evaluations_per_step: int | None = field(default=None, init=False)  # 2 m, and one a round
    stiff: ClassVar[bool] = True
    needs_jacobian: ClassVar[bool] = True

    def __post_init__(self) -> None:
        rows = self.tableau.a
        if any(len(row) != i + 1 or row[i] != rows[0][0] or float(row[i]) <= 0 for i, row in enumerate(rows)):
            raise QueryError(f"{self.name}: row i must have i + 1 entries, the last of them the same γ > 0 in all rows")
        object.__setattr__(self, "order", self.tableau.order)

    def step(self, system: System, t: Any, y: Array, h: Any) -> Array:
        h = _step_of(self, y, h)
        a, b, c, *_ = self.tableau.arrays(arithmetic_like(y))
        h_gamma = h * a[0, 0]
        try:  # the inverse: it is used in many rounds, and Newton's iteration corrects its rounding
            inverse = np.linalg.inv(np.eye(y.shape[-1], dtype=y.dtype) - h_gamma * system.jacobian(t, y))
        except np.linalg.LinAlgError:
            raise singular(self, t, h) from None
        k: list[Array] = []
        with np.errstate(over="ignore", invalid="ignore"):  # a diverging iteration is reported
            for i, node in enumerate(c):
                known = (combine(a[i, :i], k) if i else np.zeros_like(y)) * h
                z = self._stage(system, t + node * h, y, known, h_gamma, inverse)
                if z is None:
                    raise IntegrationError(
                        f"{self.name}: Newton's iteration for the step {float(h)} at t = {float(t)} does not converge "
                        f"in {MOST_ITERATIONS} rounds: take a smaller step, or Rosenbrock",
                        t,
                    )
                k.append((z - known) / h_gamma)  # not f(y + z): a stiff f would magnify the rounding of z
        return y + h * combine(b, k)

    @staticmethod
    def _stage(system: System, at: Any, y: Array, known: Array, h_gamma: Any, inverse: Array) -> Array | None:
        """Solve z = known + h γ f(at, y + z)."""

        def newton(z: Array) -> Array:
            return z + apply(inverse, known + h_gamma * system.rate(at, y + z) - z)

        return fixed_point(newton, known, y)


def _step_of(method: Integrator, y: Array, h: Any) -> Any:
    if y.dtype not in (np.dtype(np.float32), np.dtype(np.float64)):
        raise QueryError(
            f"{method.name} works in float32 and float64, got {y.dtype}: convert y, or take an explicit or Gauss method"
        )
    return arithmetic_like(y).number(h)


def _alexander() -> ButcherTableau:
    gamma = 0.43586652150845899942  # root of γ³ − 3 γ² + 3 γ/2 − 1/6, that makes it L-stable
    b1 = -(6 * gamma**2 - 16 * gamma + 1) / 4
    b2 = (6 * gamma**2 - 20 * gamma + 5) / 4
    middle = (1 + gamma) / 2
    rows = ((gamma,), (middle - gamma, gamma), (b1, b2, gamma))
    return ButcherTableau(a=rows, b=rows[-1], c=(gamma, middle, 1), order=3)


# Alexander, 1977, L-stable and stiffly accurate. HW II, table IV.6.4 and (6.16)
SDIRK_3 = SinglyDiagonallyImplicit("sdirk_3", _alexander())
