"""Moreau–Jean time stepping: velocities may jump within a step, at impacts and where dry friction stops a joint.

    q_m = q + h/2 v,   v⁺ from M(q_m) (v⁺ − v) = h (τ − C v − N) + the impulses on held joints,
    q⁺ = q_m + h/2 v⁺

The impulses solve a convex problem in v⁺. Events within a step are neither located nor counted, and the order is 1.
Without set-valued effects it is the position form of the Störmer–Verlet method, extended to forces that depend on v.
[Moreau 1988; Jean, The non-smooth contact dynamics method, 1999; Acary, Brogliato, Numerical Methods for Nonsmooth
Dynamical Systems, 2008, §10.1]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple, final

import numpy as np

from robot_dyn.foundations.arithmetic import Arithmetic, Array, Scalar
from robot_dyn.foundations.convex import active_set
from robot_dyn.integrate.integrator import FixedStepper, PlainMethod, RightSide, States, System, arithmetic_like
from robot_dyn.integrate.primitives import copy, evaluate


class Problem(NamedTuple):
    """Layout of the convex problem of n joints in an array: the first row of each part, after v⁺ and its places.

    Attributes:
        changed: Number of places that changed.
        M: The upper triangle of the mass matrix, by rows.
        p: M v and the known impulses, (n,).
        f: Largest impulses of friction, (n,).
        lower, upper: Bounds of v⁺, (n,).
        u: The actuation, the first of the torques that do work, (n,).
        rest: The other torques that do work, then the rates of controller and effect states, then shares of effects.
    """

    changed: int
    M: int
    p: int
    f: int
    lower: int
    upper: int
    u: int
    rest: int


def problem_rows(n: int) -> Problem:
    """Return the layout of the problem of n joints."""
    M = 2 * n + 1
    p = M + n * (n + 1) // 2
    f, lower, upper, u, rest = (p + k * n for k in range(1, 6))
    return Problem(changed=2 * n, M=M, p=p, f=f, lower=lower, upper=upper, u=u, rest=rest)


class Work(NamedTuple):
    """The arrays of a step.

    Attributes:
        K: v and u of the latest step, in the rows of a rate, (1, r, W).
        y: The state, the step, and the places of v⁺ after the previous step, (m + 1 + n, W).
        out: y⁺, then the rows of `Problem`, (m + R, W).
        again: y⁺ of runs that are solved separately, (m, W).
        M, problem, L: Arrays for the problem of one run, (n, n), (6, n) and (n + 1, n).
    """

    K: Array
    y: Array
    out: Array
    again: Array
    M: Array
    problem: Array
    L: Array


def time_step(f: RightSide, rows: Problem, work: Work, t: Scalar, h: Scalar, x: States) -> int:
    """Take a step; see `FixedStepper` for the arguments. The solution starts from the places of the previous step."""
    n, m, out, y, after = len(work.M), len(x.y), work.out, x.y, x.after
    copy(work.y[:m], y)
    for b in range(y.shape[1]):
        work.y[m, b], x.failed[b] = h, 0
    evaluate(f.step, t + h / 2, work.y, x.p, x.run_parameters, out)
    copy(after, out[:m])
    alone = False
    for b in range(y.shape[1]):
        if out[m + rows.changed, b] > 0.0:
            alone = True
            x.failed[b] = 0 if solved_alone(rows, work, out[m:], b) else 1
    if alone:
        evaluate(f.after_step, t, work.y[: m + 1], x.p, out[m:], work.again)
        for b in range(y.shape[1]):
            if out[m + rows.changed, b] > 0.0:
                for e in range(m):
                    after[e, b] = work.again[e, b]
    copy(work.y[m + 1 :], out[m + n : m + 2 * n])
    copy(work.K[0, :n], y[n : 2 * n])
    recorded = work.K.shape[1] - m  # runs in lock step do not record their actuation
    copy(work.K[0, m:], out[m + rows.u : m + rows.u + recorded])
    return 1


def solved_alone(rows: Problem, work: Work, out: Array, b: int) -> bool:
    """Solve the problem of run b by the active-set method if Newton's method cycles; return False without a solution.

    Args:
        rows: Layout of the problem in `out`.
        work: Work arrays of the step.
        out: The problem; v⁺ and its places are written.
        b: Index of the run.
    """
    n, k, problem = len(work.M), rows.M, work.problem
    for i in range(n):
        for j in range(i, n):
            work.M[i, j] = work.M[j, i] = out[k, b]
            k += 1
    for i in range(n):
        for row in range(4):
            problem[row, i] = out[rows.p + row * n + i, b]
    v, place = problem[4], problem[5]
    solved = active_set(work.M, problem[0], problem[1], problem[2], problem[3], v, place, work.L)
    for i in range(n):
        out[i, b], out[n + i, b] = v[i], place[i]
    return solved


@final
@dataclass(frozen=True)
class MoreauJean(PlainMethod):
    """The Moreau–Jean method of order 1, which steps through impacts and sticking friction without events.

    It also applies to equations y' = f(t, y) without jumps, with y = (q, v, quadratures) and q' = v.
    """

    name: str = "MoreauJean"
    order: int = field(default=1, init=False)
    evaluations_per_step: int | None = field(default=1, init=False)

    nonsmooth: ClassVar[bool] = True

    def stepper(
        self, kind: Arithmetic, m: int, n: int, rows: int, runs: int = 1, widths: Array | None = None
    ) -> FixedStepper:
        places, most = problem_rows(n), (m - 2 * n) * (n + 1)
        work = Work(
            K=np.zeros((1, rows, runs)),
            y=np.zeros((m + 1 + n, runs)),
            out=np.zeros((m + places.rest + most, runs)),
            again=np.zeros((m, runs)),
            M=np.empty((n, n)),
            problem=np.empty((6, n)),
            L=np.empty((n + 1, n)),
        )
        return FixedStepper(time_step, places, work)

    def step(self, system: System, t: Scalar, y: Array, h: Scalar) -> Array:
        n, h = system.n, arithmetic_like(y).number(h)
        half = h / 2
        middle, after = np.array(y), np.array(y)
        middle[..., :n] = y[..., :n] + y[..., n : 2 * n] * half
        rate = system.rate(t + half, middle)
        after[..., n:] = y[..., n:] + rate[..., n:] * h
        after[..., :n] = middle[..., :n] + after[..., n : 2 * n] * half
        return after
