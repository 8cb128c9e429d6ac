"""DOP853: the explicit method of order 8 of Dormand and Prince with error estimates of orders 5 and 3.

    y⁺ = y + h (k₁ + Σ b_j (k_j − k₁)),   ‖e‖ = |h| ‖e₅‖² / √(‖e₅‖² + 0.01 ‖e₃‖²),   dense output of order 7

Stages are stored as differences from the first, because Σ |b_j| is 13, and Σ b_j, as rounded, is not 1. One b_j is
rounded so that Σ b_j c_j is ½ to the last bit; free fall would otherwise gain 1e-15 of its energy in each step. Where
dense output is needed, three more stages are computed.

[Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.5, II.6 and II.10]
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from typing import NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array, Scalar
from robot_dyn.integrate import dop853_coefficients as table
from robot_dyn.integrate.integrator import RightSide, States
from robot_dyn.integrate.primitives import combination, copy, evaluate, norm, subtract
from robot_dyn.integrate.step_control import ControlledStepper

_STAGES, _EXTENDED, _DEGREE, _ERROR_ORDER = table.STAGES, table.EXTENDED, 7, 8


class Coefficients(NamedTuple):
    """Coefficients for differences of the stages.

    Attributes:
        a, b, c: Coefficients of all 16 stages, (16, 16), (12,) and (16,).
        e3, e5: Weights of the error estimates, (12,).
        d: Weights of the dense output, (4, 16).
        end: Weights that select the rate at the end, (13,).
    """

    a: Array
    b: Array
    c: Array
    e3: Array
    e5: Array
    d: Array
    end: Array


class Work(NamedTuple):
    """The arrays of a step.

    Attributes:
        K: k₁, and k_j − k₁ for j > 1, (16, r, 1).
        last: The rate at the end of the step, (r, 1).
        F: Dense output, (7, m, 1), see `between`.
        error: Error estimates of orders 5 and 3 for the first k entries of y, which are controlled, (2, k, 1).
        zero: Zeros, (m, 1).
    """

    K: Array
    last: Array
    F: Array
    error: Array
    zero: Array


@cache
def coefficients() -> Coefficients:
    """Return the coefficients for differences of the stages."""
    a, c = table.A.copy(), table.C
    a[:, 0] = c  # Σ_j a_ij = c_i, so this is the weight of k₁
    b, d, e3, e5 = table.B.copy(), table.D.copy(), table.E3.copy(), table.E5.copy()
    b[0], d[:, 0], e3[0], e5[0] = 1.0, 0.0, 0.0, 0.0
    smallest = int(np.flatnonzero(b)[np.argmin(np.abs(b[b != 0]))])  # with the finest spacing of floats
    b[smallest] += float(
        (Fraction(1, 2) - sum(Fraction(x) * Fraction(y) for x, y in zip(b, c, strict=False))) / Fraction(c[smallest])
    )
    a[_STAGES, 1:_STAGES] = b[1:]
    end = np.zeros(_STAGES + 1)
    end[[0, _STAGES]] = 1.0
    return Coefficients(a=a, b=b, c=c, e3=e3, e5=e5, d=d, end=end)


def stepper(m: int, rows: int, bounded: int) -> ControlledStepper:
    """Return the method for one state of m entries, with `rows` entries of a rate and `bounded` entries of an error."""
    work = Work(
        K=np.zeros((_EXTENDED, rows, 1)),
        last=np.zeros((rows, 1)),
        F=np.zeros((_DEGREE, m, 1)),
        error=np.zeros((2, bounded, 1)),
        zero=np.zeros((m, 1)),
    )
    numbers = coefficients()
    return ControlledStepper(
        step=step, error=error, dense=dense, coefficients=numbers, work=work, error_order=_ERROR_ORDER
    )


def step(f: RightSide, c: Coefficients, work: Work, t: Scalar, h: Scalar, x: States) -> int:
    """Take a trial step; see `ControlledStepper`."""
    y, after, p, run_parameters, K = x.y, x.after, x.p, x.run_parameters, work.K
    x.failed[0] = 0
    for i in range(1, _STAGES):
        combination(after, y, h, c.a[i], K, i)
        evaluate(f.rate, t + c.c[i] * h, after, p, run_parameters, K[i])
        subtract(K[i], K[0])
    combination(after, y, h, c.b, K, _STAGES)
    return _STAGES - 1


def error(c: Coefficients, work: Work, h: Scalar, x: States, rtol: float, atol: float) -> float:
    """Return the norm of the local error of a trial step; see `ControlledStepper`."""
    y, after, fifth, third = x.y, x.after, work.error[0], work.error[1]
    k = len(fifth)
    combination(fifth, work.zero[:k], 1.0, c.e5, work.K, _STAGES)
    combination(third, work.zero[:k], 1.0, c.e3, work.K, _STAGES)
    large, small = norm(fifth, y[:k], after[:k], rtol, atol), norm(third, y[:k], after[:k], rtol, atol)
    if large == 0.0:
        return 0.0
    return abs(h) * large * large / np.sqrt(large * large + 0.01 * small * small)


def dense(f: RightSide, c: Coefficients, work: Work, t: Scalar, h: Scalar, x: States) -> int:
    """Compute the dense output, from three further stages; see `ControlledStepper`."""
    F, K = work.F, work.K
    copy(K[_STAGES], work.last)
    subtract(K[_STAGES], K[0])
    for i in range(_STAGES + 1, _EXTENDED):
        combination(F[0], x.y, h, c.a[i], K, i)
        evaluate(f.rate, t + c.c[i] * h, F[0], x.p, x.run_parameters, K[i])
        subtract(K[i], K[0])
    copy(F[0], x.after)
    subtract(F[0], x.y)
    combination(F[1], work.zero, h, c.b, K, 1)
    subtract(F[1], F[0])
    combination(F[2], F[0], -h, c.end, K, _STAGES + 1)
    subtract(F[2], F[1])
    for i in range(4):
        combination(F[3 + i], work.zero, h, c.d[i], K, _EXTENDED)
    return _EXTENDED - _STAGES - 1
