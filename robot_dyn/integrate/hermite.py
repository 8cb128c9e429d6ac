"""Fixed-step methods prepared for a loop that ends steps at events, with dense output by the cubic Hermite polynomial.

    y(t + θ h) ≈ y + θ (Δ + (1 − θ) (h f − Δ + θ (2 Δ − h (f + f⁺)))),   Δ = y⁺ − y

The polynomial only brackets an event; the method itself takes the step that ends there. [Hairer, Nørsett, Wanner,
Solving Ordinary Differential Equations I, 2nd ed., 1993, II.6, (6.7)]
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import FLOAT64, Array, Scalar
from robot_dyn.integrate.integrator import Integrator, RightSide, States
from robot_dyn.integrate.primitives import combination, copy, subtract
from robot_dyn.integrate.step_control import ControlledStepper


class Numbers(NamedTuple):
    """The coefficients of the method, and the weights that select the rate at the start or at the end."""

    method: Any
    one: Array
    end: Array


class Work(NamedTuple):
    """The arrays of a step.

    Attributes:
        method: Arrays of the method.
        K: The rates at the start and at the end, (2, r, 1).
        last: The rate at the end, (r, 1).
        F: Dense output, (3, m, 1), see `between`.
        error: Empty, (0, m, 1).
        zero: Zeros, (m, 1).
    """

    method: Any
    K: Array
    last: Array
    F: Array
    error: Array
    zero: Array


def stepper(method: Integrator, m: int, n: int, rows: int, widths: Array | None) -> ControlledStepper:
    """Return a fixed-step method for one state of m entries, n of them positions, and rates of `rows` entries."""
    inner = method.stepper(FLOAT64, m, n, rows, 1, widths)
    work = Work(
        method=inner.work,
        K=np.zeros((2, rows, 1)),
        last=np.zeros((rows, 1)),
        F=np.zeros((3, m, 1)),
        error=np.zeros((0, m, 1)),
        zero=np.zeros((m, 1)),
    )
    step, numbers = (_cached_step if method.plain else step_of)(inner.step), Numbers(inner.coefficients, *np.eye(2))
    return ControlledStepper(step=step, error=no_error, dense=dense, coefficients=numbers, work=work, error_order=1)


def step_of(inner: Callable[..., int]) -> Callable[..., int]:
    """Return the step of a method whose coefficients and arrays are fields of `Numbers` and `Work`."""

    def step(f: RightSide, c: Numbers, work: Work, t: Scalar, h: Scalar, x: States) -> int:
        x.failed[0] = 0
        return inner(f, c.method, work.method, t, h, x)

    return step


_cached_step = cache(step_of)  # machine code is built once for each function


def no_error(c: Numbers, work: Work, h: Scalar, x: States, rtol: float, atol: float) -> float:
    """Return 0: a fixed-step method has no error estimate."""
    return 0.0


def dense(f: RightSide, c: Numbers, work: Work, t: Scalar, h: Scalar, x: States) -> int:
    """Compute the cubic Hermite polynomial of a step; see `ControlledStepper`."""
    F = work.F
    copy(work.K[1], work.last)
    copy(F[0], x.after)
    subtract(F[0], x.y)
    combination(F[1], work.zero, h, c.one, work.K, 1)
    subtract(F[1], F[0])
    combination(F[2], F[0], -h, c.end, work.K, 2)
    subtract(F[2], F[1])
    return 0
