"""Rosenbrock methods: one matrix a step, one linear system a stage, no iteration.

    (1 − h γ J) u_i = h γ f(t + α_i h, y + Σ_{j<i} a_ij u_j) + γ Σ_{j<i} c_ij u_j + γ γ_i h² ∂f/∂t
    y⁺ = y + Σ_i m_i u_i,   y(t + θ h) = y + θ (y⁺ − y) + θ (1 − θ) Σ_i (h_0i + θ (h_1i + θ h_2i)) u_i

with J = ∂f/∂y and ∂f/∂t at (t, y); y⁺ without its last u_i is of an order less. [Hairer, Wanner, Solving Ordinary
Differential Equations II, 2nd ed., 1996, IV.7, (7.25)]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, final

import numpy as np

from robot_dyn.foundations.arithmetic import FLOAT64, Arithmetic, Array
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.values import aligned
from robot_dyn.integrate.integrator import IntegrationError, PlainMethod, RightSide, Stepper
from robot_dyn.integrate.primitives import combination, copy, evaluate, factor, norm, solve, subtract
from robot_dyn.integrate.rosenbrock_table import RODAS5P, Numbers, RosenbrockTable
from robot_dyn.integrate.step_control import ControlledStepper, rate_at_end


class Linear(NamedTuple):
    """The arrays of a step.

    Attributes:
        K: f at the start, h ∂f/∂t, and the latest f, (3, r, W).
        last: The latest f, (r, W).
        U: u_i, (s, m, W).
        J: ∂f/∂y_j for each j, then ∂f/∂t, (m + 1, m, W).
        A, rows: Factors of 1 − h γ J, (m, m, W), and the rows that they exchange, (m, W).
        known, zero: A right-hand side, and 0, (m, W).
        at, y: Time and state of J, (1,) and (m, W).
        F: Dense output of one run, (4, m, W), as of `between`.
        error: Local error of the entries whose error is bounded, (1, k, W).
    """

    K: Array
    last: Array
    U: Array
    J: Array
    A: Array
    rows: Array
    known: Array
    zero: Array
    at: Array
    y: Array
    F: Array
    error: Array


def begin(f: RightSide, table: Numbers, t: Any, y: Array, p: Array, run_parameters: Array, work: Linear) -> int:
    """Evaluate what depends on t and y alone: f and its derivatives."""
    evaluate(f.rate, t, y, p, run_parameters, work.K[0])
    differentiate(f, t, y, p, run_parameters, work)
    return 1


def differentiate(f: RightSide, t: Any, y: Array, p: Array, run_parameters: Array, work: Linear) -> None:
    """Evaluate the derivatives at t and y."""
    evaluate(f.jacobian, t, y, p, run_parameters, work.J)
    work.at[0] = t
    copy(work.y, y)


def stages(
    f: RightSide, table: Numbers, t: Any, h: Any, y: Array, p: Array, run_parameters: Array, after: Array, work: Linear,
    lost: Array,
) -> int:  # fmt: skip
    """Write the step, from these derivatives."""
    K, U, h_gamma = work.K, work.U, h * table.gamma
    factor(work.A, work.J, h_gamma, work.rows, lost)
    combination(K[1][: len(y)], work.zero, h, table.last, work.J, len(work.J))
    for i in range(len(table.m)):
        if i > 0:
            combination(after, y, table.one, table.a[i], U, i)
            evaluate(f.rate, t + table.alpha[i] * h, after, p, run_parameters, K[2])
        combination(work.known, work.zero, h_gamma, table.f[i], K, 3 if i > 0 else 2)
        combination(U[i], work.known, table.gamma, table.c[i], U, i)
        solve(work.A, work.rows, U[i])
    combination(after, y, table.one, table.m, U, len(table.m))
    return len(table.m) - 1


def rosenbrock_step(
    f: RightSide, table: Numbers, t: Any, h: Any, y: Array, p: Array, run_parameters: Array, after: Array, work: Linear,
    lost: Array,
) -> int:  # fmt: skip
    """A step of a Rosenbrock method; arguments as of `Stepper`."""
    first = begin(f, table, t, y, p, run_parameters, work)
    return first + stages(f, table, t, h, y, p, run_parameters, after, work, lost)


def trial(
    f: RightSide, table: Numbers, t: Any, h: Any, y: Array, p: Array, run_parameters: Array, after: Array, work: Linear,
    lost: Array,
) -> int:  # fmt: skip
    """Write a trial step, with the derivatives of `begin` where t and y are the same; see `ControlledStepper`."""
    known = work.at[0] == t
    for e in range(len(y)):
        known &= work.y[e, 0] == y[e, 0]
    if not known:
        differentiate(f, t, y, p, run_parameters, work)
    return stages(f, table, t, h, y, p, run_parameters, after, work, lost)


def error(table: Numbers, h: Any, y: Array, after: Array, work: Linear, rtol: float, atol: float) -> float:
    """Return the norm of the last u_i, which the method of lower order lacks; see `ControlledStepper`."""
    k = work.error.shape[1]
    return norm(work.U[len(work.U) - 1][:k], y[:k], after[:k], rtol, atol)


def dense(
    f: RightSide, table: Numbers, t: Any, h: Any, y: Array, p: Array, run_parameters: Array, after: Array, work: Linear
) -> int:
    """The polynomial between; see `ControlledStepper`."""
    F = work.F
    copy(F[0], after)
    subtract(F[0], y)
    for i in range(len(table.dense)):
        combination(F[i + 1], work.zero, table.one, table.dense[i], work.U, len(work.U))
    return 0


@final
@dataclass(frozen=True)
class Rosenbrock(PlainMethod):
    """The Rosenbrock method of a table, in floats.

    J is that of the start of a step: where the rate bends within a step, as regularised dry friction does when a joint
    comes to rest, the step does not account for the bend, and v chatters about 0 by h |a|. The
    order rests on an exact J, which machine code has; differences err by u^(2/3) = 4e-11 of it.
    """

    name: str
    table: RosenbrockTable
    order: int = field(init=False)
    evaluations_per_step: int | None = field(init=False)
    stiff: ClassVar[bool] = True
    needs_jacobian: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "order", self.table.order)
        object.__setattr__(self, "evaluations_per_step", len(self.table.m))

    def stepper(
        self, kind: Arithmetic, m: int, n: int, rows: int, runs: int = 1, widths: Array | None = None
    ) -> Stepper:
        if kind.dtype == object:
            raise QueryError(
                f"{self.name} works in floats, not in balls: convert y, or take an explicit or a Gauss method"
            )
        return Stepper(rosenbrock_step, self.table.numbers(kind, m), self._work(kind, m, rows, runs, m))

    def controlled(self, m: int, rows: int, bounded: int) -> ControlledStepper:
        """Return the method with control of its error, as `dop853.stepper`."""
        table, work = self.table.numbers(FLOAT64, m), self._work(FLOAT64, m, rows, 1, bounded)
        return ControlledStepper(begin, trial, error, rate_at_end, dense, table, work, self.order)

    def _work(self, kind: Arithmetic, m: int, rows: int, runs: int, bounded: int) -> Linear:
        s, dtype = len(self.table.m), kind.dtype
        shapes = (3, rows), (s, m), (m + 1, m), (m, m), (4, m), (1, bounded)
        K, U, J, A, F, error = (aligned((*shape, runs), dtype) for shape in shapes)
        known, zero, y = aligned((3, m, runs), dtype)
        exchanged = np.zeros((m, runs), np.int64)
        return Linear(K, K[2], U, J, A, exchanged, known, zero, np.full(1, np.nan), y, F, error)

    def not_found(self, t: Any, h: Any) -> IntegrationError:
        return IntegrationError(
            f"{self.name}: 1 − h γ J is singular for the step {float(h)} at t = {float(t)}: take a smaller step", t
        )


ROSENBROCK_5 = Rosenbrock("rosenbrock_5", RODAS5P)
