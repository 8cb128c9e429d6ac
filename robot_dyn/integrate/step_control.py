"""Step-size control by a PI controller: the longest step with a local error within the tolerance.

    ‖e‖ ≤ 1,   h⁺ = h · 0.9 ‖e‖^(−α) ‖e₋‖^β,   e the local error over atol + rtol |y|, e₋ of the previous step

[Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.4; Hairer, Wanner, II, 2nd ed.,
1996, IV.2; Gustafsson 1991]
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any, NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array, Scalar
from robot_dyn.integrate.integrator import RightSide, States
from robot_dyn.integrate.primitives import combination, evaluate, norm, subtract

_BETA_ORDER = 0.2  # β times the order of the error: the weight of the previous error in the next step
_SAFETY, _MIN, _MAX = 0.9, 0.2, 10.0  # safety factor, and limits of the factor of a new step
_NOT_FINITE = 0.1  # factor of a step whose error is not finite
_STRETCH = 1.01  # a step is stretched to the end, to avoid a tiny last step
_SPACINGS = 4  # shortest step, in spacings of floats at t
_ONE, _NO_MESH = np.ones(1), np.zeros(0)


class StepControl(NamedTuple):
    """The state of step control: arrays of length 1, then constants.

    Attributes:
        next_h: Length of the next step, not negative; 0 before the first.
        h: The latest step, with its sign.
        end: End of the latest step.
        error: ‖e₋‖, limited from below.
        mesh_index: Index of the next time of the mesh.
        mesh: Times at which steps must end, (k,); error control may add others. (0,) for none.
        rtol, atol: Tolerances, both 0 if only the mesh determines the steps.
        longest: Longest step.
        exponent: 1 over the order of ‖e‖ in h.
    """

    next_h: Array
    h: Array
    end: Array
    error: Array
    mesh_index: Array
    mesh: Array
    rtol: float
    atol: float
    longest: float
    exponent: float


def rate_at_start(f: RightSide, c: Any, work: Any, t: Scalar, x: States) -> int:
    """Write the rate into work.K[0]; the `begin` of a method without further terms."""
    evaluate(f.rate, t, x.y, x.p, x.run_parameters, work.K[0])
    return 1


def rate_at_end(f: RightSide, c: Any, work: Any, t: Scalar, h: Scalar, x: States) -> int:
    """Write the rate at the end of a step into work.last; the `accept` of every method in this package."""
    evaluate(f.rate, t + h, x.after, x.p, x.run_parameters, work.last)
    return 1


class ControlledStepper(NamedTuple):
    """A method prepared for steps with error control, for one state (m, 1).

    Functions are plain; f has the functions of a `RightSide`, c are the coefficients, x has the arrays of `States`.

    Attributes:
        step: (f, c, work, t, h, x) → evaluations. It takes a trial step: it writes y(t + h) into x.after.
        error: (c, work, h, x, rtol, atol) → ‖e‖.
        dense: (f, c, work, t, h, x) → evaluations. It writes the polynomial of `between` into work.F, (d, m, 1).
        coefficients: Coefficients c of the method.
        work: Work arrays; work.error, (…, k, 1), covers the first k entries of y, whose error is controlled.
        error_order: Order of ‖e‖ in h.
        begin: (f, c, work, t, x) → evaluations. It computes terms that depend only on (t, y), and writes the rate into
            work.K[0], (r, 1).
        accept: (f, c, work, t, h, x) → evaluations. It writes the rate at the end of the step into work.last, (r, 1).
    """

    step: Callable[..., int]
    error: Callable[..., float]
    dense: Callable[..., int]
    coefficients: Any
    work: Any
    error_order: int
    begin: Callable[..., int] = rate_at_start
    accept: Callable[..., int] = rate_at_end


def initial_control(
    error_order: int, rtol: float = 0.0, atol: float = 0.0, longest: float = inf, mesh: np.ndarray = _NO_MESH
) -> StepControl:
    """Return the state of step control before the first step; see `StepControl` for the arguments."""
    next_h, h, end, error = np.zeros((4, 1))
    error[0] = 1e-4
    return StepControl(
        next_h=next_h,
        h=h,
        end=end,
        error=error,
        mesh_index=np.zeros(1, np.int64),
        mesh=mesh,
        rtol=float(rtol),
        atol=float(atol),
        longest=float(longest),
        exponent=1 / error_order,
    )


def first_step(f: Any, work: Any, control: StepControl, t: float, end: float, x: Any) -> int:
    """Write the length of the first step, from the rates at its start and after a short Euler step; 1 evaluation.

    f has the functions of a `RightSide`, x the arrays of `States`.

    [Hairer, Nørsett, Wanner 1993, II.4]
    """
    k, rtol, atol = work.error.shape[1], control.rtol, control.atol
    y, rate = x.y[:k], work.K[0][:k]
    size, slope = norm(y, y, y, rtol, atol), norm(rate, y, y, rtol, atol)
    is_usable = size >= 1e-5 and 1e-5 <= slope < np.inf  # inf where an entry is 0 and atol is (nearly) 0
    h = 0.01 * size / slope if is_usable else 1e-6
    h = min(h, abs(end - t), control.longest)
    signed = h if end >= t else -h
    combination(x.after, x.y, signed, _ONE, work.K, 1)
    evaluate(f.rate, t + signed, x.after, x.p, x.run_parameters, work.last)
    subtract(work.last, work.K[0])
    steepest = max(slope, norm(work.last[:k], y, y, rtol, atol) / h)
    other = (0.01 / steepest) ** control.exponent if 1e-15 < steepest < np.inf else max(1e-6, 1e-3 * h)
    control.next_h[0] = min(100 * h, other)
    return 1


def next_of_mesh(control: StepControl, t: float, end: float) -> float:
    """Return the first time of the mesh after t, or `end` if that is earlier."""
    mesh = control.mesh
    k: int = control.mesh_index[0]
    while k < len(mesh) and mesh[k] <= t:
        k += 1
    control.mesh_index[0] = k
    return min(mesh[k], end) if k < len(mesh) else end


def is_finite(x: Array) -> bool:
    """Return True if all numbers of an array (m, 1) are finite."""
    total = 0.0
    for e in range(len(x)):
        total += abs(x[e, 0])
    return total < np.inf


def controls_error(control: StepControl) -> bool:
    """Return True if the error determines the steps, not only the mesh."""
    return control.rtol + control.atol > 0.0


def shortened(control: StepControl, h: float, e: float) -> float:
    """Return the length of the next trial after a step of length h is rejected with the error e."""
    return abs(h) * (max(_MIN, _SAFETY * e**-control.exponent) if e < np.inf else _NOT_FINITE)


def adapt(control: StepControl, h: float, e: float, reaches_end: bool, rejected: bool) -> None:
    """Write the length of the next step after a step of length h is accepted with the error e, by the PI controller.

    A step that is shortened to end at the end of a segment does not lower the next length, `control.next_h`.
    """
    alpha = control.exponent
    beta = _BETA_ORDER * alpha
    factor = _MAX
    if e > 0.0:
        factor = min(_MAX, max(_MIN, _SAFETY * e ** (0.75 * beta - alpha) * control.error[0] ** beta))
    next_h = h * (min(1.0, factor) if rejected else factor)
    control.next_h[0] = max(next_h, control.next_h[0]) if reaches_end and not rejected else next_h
    control.error[0] = max(e, 1e-4)


def chosen_step(step: Callable[..., int], error: Callable[..., float]) -> Callable[..., tuple[int, bool]]:
    """Return the function that chooses and takes a step, for the `step` and `error` of a method.

    choose(f, c, work, control, t, end, x) → evaluations, and True if a step succeeds. It returns False if the tolerance
    requires a step shorter than a few spacings of floats at t, or if a step set by the mesh alone fails. Steps end at
    the times of the mesh, or earlier if the error requires.
    """

    def choose(
        f: RightSide, c: Any, work: Any, control: StepControl, t: float, end: float, x: States
    ) -> tuple[int, bool]:
        end = next_of_mesh(control, t, end)
        if not controls_error(control):
            control.h[0], control.end[0] = end - t, end
            evaluations = step(f, c, work, t, end - t, x)
            return evaluations, x.failed[0] == 0 and is_finite(x.after)
        left, evaluations, rejected = abs(end - t), 0, False
        control.next_h[0] = min(control.next_h[0], control.longest)
        least = _SPACINGS * (np.nextafter(abs(t), np.inf) - abs(t))
        while True:
            reaches_end = control.next_h[0] * _STRETCH >= left
            h = left if reaches_end else control.next_h[0]
            if h < least and not reaches_end:
                return evaluations, False
            signed = h if end >= t else -h
            evaluations += step(f, c, work, t, signed, x)
            e = error(c, work, signed, x, control.rtol, control.atol) if x.failed[0] == 0 else np.inf
            if e <= 1.0:
                break
            rejected = True
            control.next_h[0] = shortened(control, h, e)
            if control.next_h[0] < least:
                return evaluations, False
        adapt(control, h, e, reaches_end, rejected)
        control.h[0], control.end[0] = signed, end if reaches_end else t + signed
        return evaluations, True

    return choose
