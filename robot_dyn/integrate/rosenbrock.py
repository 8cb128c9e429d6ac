"""Rosenbrock methods: one matrix per step, one linear system per stage, no iteration.

    (1 − h γ J) u_i = h γ f(t + α_i h, y + Σ_{j<i} a_ij u_j) + γ Σ_{j<i} c_ij u_j + γ γ_i h² ∂f/∂t
    y⁺ = y + Σ_i m_i u_i,   y(t + θ h) = y + θ (y⁺ − y) + θ (1 − θ) Σ_i (h_0i + θ (h_1i + θ h_2i)) u_i

with J = ∂f/∂y and ∂f/∂t at (t, y). Without its last u_i, y⁺ is the embedded method of one order less. [Hairer, Wanner,
Solving Ordinary Differential Equations II, 2nd ed., 1996, IV.7, (7.25)]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple, final

import numpy as np

from robot_dyn.foundations.arithmetic import FLOAT64, Arithmetic, Array, Scalar
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.values import aligned
from robot_dyn.integrate.integrator import FixedStepper, IntegrationError, PlainMethod, RightSide, States
from robot_dyn.integrate.primitives import combination, copy, evaluate, factor, norm, solve, subtract
from robot_dyn.integrate.rosenbrock_table import RODAS5P, Numbers, RosenbrockTable
from robot_dyn.integrate.step_control import ControlledStepper


class Linear(NamedTuple):
    """Work arrays of a Rosenbrock step.

    Attributes:
        K: f at the start, h ∂f/∂t, and the latest f, (3, r, W).
        last: The latest f, (r, W).
        U: u_i, (s, m, W).
        J: ∂f/∂y_j for each j, then ∂f/∂t, (m + 1, m, W).
        A, rows: Factors of 1 − h γ J, (m, m, W), and the row exchanges, (m, W).
        rhs, zero: Right-hand side of a linear system, and zeros, (m, W).
        t_J, y_J: Time and state of J, (1,) and (m, W).
        F: Dense output of one run, (4, m, W), see `between`.
        error: Local error of the entries whose error is bounded, (1, k, W).
    """

    K: Array
    last: Array
    U: Array
    J: Array
    A: Array
    rows: Array
    rhs: Array
    zero: Array
    t_J: Array
    y_J: Array
    F: Array
    error: Array


def begin(f: RightSide, table: Numbers, work: Linear, t: Scalar, x: States) -> int:
    """Evaluate f and its derivatives, which depend only on t and y; return the number of evaluations of f."""
    evaluate(f.rate, t, x.y, x.p, x.run_parameters, work.K[0])
    differentiate(f, work, t, x)
    return 1


def differentiate(f: RightSide, work: Linear, t: Scalar, x: States) -> None:
    """Evaluate the derivatives at t and y."""
    evaluate(f.jacobian, t, x.y, x.p, x.run_parameters, work.J)
    work.t_J[0] = t
    copy(work.y_J, x.y)


def stages(f: RightSide, table: Numbers, work: Linear, t: Scalar, h: Scalar, x: States) -> int:
    """Compute the stages and the new state with the derivatives in `work`; return the number of evaluations."""
    K, U, h_gamma = work.K, work.U, h * table.gamma
    y, after, p, run_parameters = x.y, x.after, x.p, x.run_parameters
    factor(work.A, work.J, h_gamma, work.rows, x.failed)
    combination(K[1][: len(y)], work.zero, h, table.last, work.J, len(work.J))
    for i in range(len(table.m)):
        if i > 0:
            combination(after, y, table.one, table.a[i], U, i)
            evaluate(f.rate, t + table.alpha[i] * h, after, p, run_parameters, K[2])
        combination(work.rhs, work.zero, h_gamma, table.f[i], K, 3 if i > 0 else 2)
        combination(U[i], work.rhs, table.gamma, table.c[i], U, i)
        solve(work.A, work.rows, U[i])
    combination(after, y, table.one, table.m, U, len(table.m))
    return len(table.m) - 1


def rosenbrock_step(f: RightSide, table: Numbers, work: Linear, t: Scalar, h: Scalar, x: States) -> int:
    """Take a step of a Rosenbrock method; see `FixedStepper` for the arguments."""
    first = begin(f, table, work, t, x)
    return first + stages(f, table, work, t, h, x)


def trial(f: RightSide, table: Numbers, work: Linear, t: Scalar, h: Scalar, x: States) -> int:
    """Take a trial step; reuse the derivatives if t and y are unchanged; see `ControlledStepper`."""
    is_current = work.t_J[0] == t
    for e in range(len(x.y)):
        is_current &= work.y_J[e, 0] == x.y[e, 0]
    if not is_current:
        differentiate(f, work, t, x)
    return stages(f, table, work, t, h, x)


def error(table: Numbers, work: Linear, h: Scalar, x: States, rtol: float, atol: float) -> float:
    """Return the norm of the last u_i, the difference from the embedded method; see `ControlledStepper`."""
    k = work.error.shape[1]
    return norm(work.U[len(work.U) - 1][:k], x.y[:k], x.after[:k], rtol, atol)


def dense(f: RightSide, table: Numbers, work: Linear, t: Scalar, h: Scalar, x: States) -> int:
    """Compute the dense output; see `ControlledStepper`."""
    F = work.F
    copy(F[0], x.after)
    subtract(F[0], x.y)
    for i in range(len(table.dense)):
        combination(F[i + 1], work.zero, table.one, table.dense[i], work.U, len(work.U))
    return 0


@final
@dataclass(frozen=True)
class Rosenbrock(PlainMethod):
    """A Rosenbrock method, defined by a table of coefficients, for floats.

    J is evaluated at the start of a step. If the rate bends within the step, as regularised dry friction does when a
    joint comes to rest, the step does not account for the bend, and v chatters about 0 by h |a|. The full order needs
    an exact J, as machine code computes it; with differences, its relative error is about u^(2/3) = 4e-11, u = 2.2e-16.
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
    ) -> FixedStepper:
        if kind.dtype == object:
            raise QueryError(f"{self.name} supports floats, not balls; convert y, or use an explicit or a Gauss method")
        return FixedStepper(rosenbrock_step, self.table.numbers(kind, m), self._work(kind, m, rows, runs, m))

    def controlled(self, m: int, rows: int, bounded: int) -> ControlledStepper:
        """Return the method with error control; see `dop853.stepper` for the arguments."""
        c, work = self.table.numbers(FLOAT64, m), self._work(FLOAT64, m, rows, 1, bounded)
        return ControlledStepper(
            step=trial, error=error, dense=dense, coefficients=c, work=work, error_order=self.order, begin=begin
        )

    def _work(self, kind: Arithmetic, m: int, rows: int, runs: int, bounded: int) -> Linear:
        s, dtype = len(self.table.m), kind.dtype
        shapes = (3, rows), (s, m), (m + 1, m), (m, m), (4, m), (1, bounded)
        K, U, J, A, F, error = (aligned((*shape, runs), dtype) for shape in shapes)
        rhs, zero, y = aligned((3, m, runs), dtype)
        return Linear(
            K=K,
            last=K[2],
            U=U,
            J=J,
            A=A,
            rows=np.zeros((m, runs), np.int64),
            rhs=rhs,
            zero=zero,
            t_J=np.full(1, np.nan),
            y_J=y,
            F=F,
            error=error,
        )

    def not_found(self, t: Scalar, h: Scalar) -> IntegrationError:
        return IntegrationError(
            f"{self.name}: 1 − h γ J is singular for the step {float(h)} at t = {float(t)}; use a smaller step", t
        )


RODAS5P_FIXED = Rosenbrock("Rodas5PFixed", RODAS5P)
