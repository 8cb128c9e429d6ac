"""Control of the step: the longest one whose local error is within the tolerance, by a PI controller.

    ‖e‖ ≤ 1,   h⁺ = h · 0.9 ‖e‖^(−α) ‖e₋‖^β,   e the local error over atol + rtol |y|, e₋ that of the step before

[Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.4; Hairer, Wanner, II, 2nd ed.,
1996, IV.2; Gustafsson 1991]
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.primitives import combination, evaluate, norm, subtract

_BETA_ORDER = 0.2  # β times the order of the error: the part that the error before has in the next step
_SAFETY, _LEAST, _MOST = 0.9, 0.2, 10.0  # of a new step
_CUT = 0.1  # of a step whose error is not a number
_STRETCH = 1.01  # to avoid a sliver of a step before the end
_SPACINGS = 4  # of floats at t: the least step
_ONE = np.ones(1)


class Choice(IntEnum):
    """The outcome of the choice of a step."""

    TAKEN = 0
    TOO_SMALL = 1  # only steps within rounding of t have an error within the tolerance


class _Entries(NamedTuple):
    """Entries of `control`, where the choice of steps is."""

    NEXT: int = 0  # length of the next step, not negative; 0 before the first
    TAKEN: int = 1  # the step that was taken, with its sign
    END: int = 2  # the time where it ends
    ERROR: int = 3  # ‖e₋‖
    RTOL: int = 4
    ATOL: int = 5
    LONGEST: int = 6
    EXPONENT: int = 7  # 1 over the order of ‖e‖ in h
    REJECTED: int = 8  # steps, in all
    MESH: int = 9  # the next time of a mesh


At = _Entries()


class ControlledStepper(NamedTuple):
    """A method prepared for steps of controlled error, for one state (m, 1).

    Functions are plain; f is the state equation (f.rate, f.jacobian), p and s, run_parameters, are as of `evaluate`.

    Attributes:
        begin: (f, c, t, y, p, s, work) → evaluations. What depends on (t, y) alone: work.K[0], (r, 1), is the rate.
        step: (f, c, t, h, y, p, s, after, work, lost) → evaluations. A trial: writes y(t + h) into `after`.
        error: (c, h, y, after, work, rtol, atol) → ‖e‖.
        accept: (f, c, t, h, y, p, s, after, work) → evaluations. work.last, (r, 1), is the rate at its end.
        dense: (f, c, t, h, y, p, s, after, work) → evaluations. work.F, (d, m, 1), as of `between`.
        coefficients: Its numbers, c.
        work: Its arrays; work.error, (…, k, 1), of the first entries of y, whose error is bounded.
        error_order: Order of ‖e‖ in h.
    """

    begin: Callable[..., int]
    step: Callable[..., int]
    error: Callable[..., float]
    accept: Callable[..., int]
    dense: Callable[..., int]
    coefficients: Any
    work: Any
    error_order: int


def rate_at_start(f: Any, c: Any, t: Any, y: Array, p: Array, run_parameters: Array, work: Any) -> int:
    """Write the rate into work.K[0]: the `begin` of a method that needs nothing else."""
    evaluate(f.rate, t, y, p, run_parameters, work.K[0])
    return 1


def rate_at_end(
    f: Any, c: Any, t: Any, h: Any, y: Array, p: Array, run_parameters: Array, after: Array, work: Any
) -> int:
    """Write the rate at the end of a step into work.last: the `accept` of every method here."""
    evaluate(f.rate, t + h, after, p, run_parameters, work.last)
    return 1


def control_of(stepper: ControlledStepper, rtol: float, atol: float, longest: float) -> np.ndarray:
    """Return the choice of steps before the first one."""
    control = np.zeros(len(At))
    control[At.ERROR], control[At.RTOL], control[At.ATOL] = 1e-4, rtol, atol
    control[At.LONGEST], control[At.EXPONENT] = longest, 1 / stepper.error_order
    return control


def first_step(
    f: Any, t: float, end: float, y: Array, p: Array, run_parameters: Array, after: Array, work: Any, control: Array
) -> int:
    """Write the length of the first step, from the rate at its start and after a short Euler step; 1 evaluation.

    [Hairer, Nørsett, Wanner 1993, II.4]
    """
    k, rtol, atol = work.error.shape[1], control[At.RTOL], control[At.ATOL]
    x, rate = y[:k], work.K[0][:k]
    size, slope = norm(x, x, x, rtol, atol), norm(rate, x, x, rtol, atol)
    known = size >= 1e-5 and 1e-5 <= slope < np.inf  # inf where an entry is 0 and atol is (nearly) 0
    h = 0.01 * size / slope if known else 1e-6
    h = min(h, abs(end - t), control[At.LONGEST])
    signed = h if end >= t else -h
    combination(after, y, signed, _ONE, work.K, 1)
    evaluate(f.rate, t + signed, after, p, run_parameters, work.last)
    subtract(work.last, work.K[0])
    steepest = max(slope, norm(work.last[:k], x, x, rtol, atol) / h)
    other = (0.01 / steepest) ** control[At.EXPONENT] if 1e-15 < steepest < np.inf else max(1e-6, 1e-3 * h)
    control[At.NEXT] = min(100 * h, other)
    return 1


def following(mesh: Array, control: Array, t: float, end: float) -> float:
    """Return the first time of a mesh after t, or the end."""
    k = int(control[At.MESH])
    while k < len(mesh) and mesh[k] <= t:
        k += 1
    control[At.MESH] = k
    return min(mesh[k], end) if k < len(mesh) else end


def finite(x: Array) -> bool:
    """Whether all numbers of (m, 1) are finite."""
    total = 0.0
    for e in range(len(x)):
        total += abs(x[e, 0])
    return total < np.inf


def shortened(h: float, e: float, control: Array) -> float:
    """Return the length of the step after one of length h that is rejected with the error e."""
    control[At.REJECTED] += 1
    return abs(h) * (max(_LEAST, _SAFETY * e ** -control[At.EXPONENT]) if e < np.inf else _CUT)


def chosen_step(step: Callable[..., int], error: Callable[..., float]) -> Callable[..., tuple[int, int]]:
    """Return the function that chooses a step, for a method's `step` and `error`.

    choose(f, c, t, end, y, p, s, after, work, lost, control, mesh) → evaluations, Choice. Steps end at the times of
    the mesh (k,), if there are any, and before them where the error asks for it: not where both tolerances are 0.
    """

    def choose(
        f: Any, c: Any, t: float, end: float, y: Array, p: Array, run_parameters: Array, after: Array, work: Any,
        lost: Array, control: Array, mesh: Array,
    ) -> tuple[int, int]:  # fmt: skip
        end = following(mesh, control, t, end)
        if control[At.RTOL] + control[At.ATOL] == 0.0:
            control[At.END], control[At.TAKEN] = end, end - t
            h = end - t
            evaluations = step(f, c, t, h, y, p, run_parameters, after, work, lost)
            return evaluations, Choice.TAKEN if lost[0] == 0 and finite(after) else Choice.TOO_SMALL
        left, evaluations, rejected = abs(end - t), 0, False
        desired = min(control[At.NEXT], control[At.LONGEST])
        least = _SPACINGS * (np.nextafter(abs(t), np.inf) - abs(t))
        while True:
            reaches = desired * _STRETCH >= left
            h = left if reaches else desired
            if h < least and not reaches:
                return evaluations, Choice.TOO_SMALL
            signed = h if end >= t else -h
            evaluations += step(f, c, t, signed, y, p, run_parameters, after, work, lost)
            e = error(c, signed, y, after, work, control[At.RTOL], control[At.ATOL]) if lost[0] == 0 else np.inf
            if e <= 1.0:
                break
            rejected = True
            desired = shortened(h, e, control)
            if desired < least:
                return evaluations, Choice.TOO_SMALL
        alpha = control[At.EXPONENT]
        beta = _BETA_ORDER * alpha
        factor = _MOST
        if e > 0.0:
            factor = min(_MOST, max(_LEAST, _SAFETY * e ** (0.75 * beta - alpha) * control[At.ERROR] ** beta))
        next_h = h * (min(1.0, factor) if rejected else factor)
        # a step that the end of a segment shortens does not reflect the error
        control[At.NEXT] = max(next_h, desired) if reaches and not rejected else next_h
        control[At.ERROR] = max(e, 1e-4)
        control[At.TAKEN], control[At.END] = signed, end if reaches else t + signed
        return evaluations, Choice.TAKEN

    return choose
