"""The order of every fixed-step method, measured: the slope of log error against log step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from robot_dyn.integrate import FIXED_STEP, System, method

HAS_LONGDOUBLE = np.finfo(np.longdouble).nmant > 52


@dataclass(frozen=True)
class Problem:
    """A second-order equation with known motion q, and the quadrature w' = q v, so w = (q² − q0²)/2."""

    acceleration: Callable[[Any, Any, Any], Any]
    motion: Callable[[Any], tuple[Any, Any]]

    def rate(self, t: Any, y: np.ndarray) -> np.ndarray:
        q, v = y[..., 0], y[..., 1]
        return np.stack([v, self.acceleration(t, q, v), q * v], axis=-1)

    def exact(self, t: Any) -> np.ndarray:
        (q0, _), (q, v) = self.motion(0 * t), self.motion(t)
        return np.stack([q, v, (q**2 - q0**2) / 2])


def driven_motion(t: Any) -> tuple[Any, Any]:
    return np.sin(t) + t / 2, np.cos(t) + 0.5


def driven_acceleration(t: Any, q: Any, v: Any) -> Any:
    """Pendulum with cubic drag, driven by what makes `driven_motion` exact: nonlinear and not autonomous."""
    at_q, at_v = driven_motion(t)
    return -np.sin(q) - v**3 / 10 + (np.sin(at_q) + at_v**3 / 10 - np.sin(t))


PROBLEMS = {
    "oscillator": Problem(lambda t, q, v: -q, lambda t: (np.cos(t) + np.sin(t) / 2, np.cos(t) / 2 - np.sin(t))),
    "driven pendulum": Problem(driven_acceleration, driven_motion),
}


def measured_order(name: str, problem: Problem) -> float:
    """Slope of log2 error at t = 2 against log2 step.

    Below order 6 in float64 with 32 to 256 steps: fine enough for the leading term to rule, and errors above 1e-11.
    From order 6 in longdouble with 4 to 16 steps: errors of 1e-6 to 1e-14, above the 1e-16 that the float64
    coefficients of DP8 leave; float64 itself would have rounded away the last of them.
    Order 5 in longdouble, too, where differences for a Jacobian are right to 1e-13.
    """
    integrator = method(name)
    high = integrator.order >= 5
    if high and not HAS_LONGDOUBLE:
        pytest.skip("np.longdouble is float64 here: rounding hides the errors of orders 5 to 8")
    kind = np.longdouble if high else np.float64
    counts = {4: [32, 64, 128, 256], 5: [8, 16, 32, 64, 128]}.get(max(integrator.order, 4), [4, 8, 16])
    end, system, errors = kind(2), System(problem.rate, 1), []
    for count in counts:
        h, y = end / count, problem.exact(kind(0))
        for i in range(count):
            y = integrator.step(system, i * h, y, h)
        assert y.dtype == kind
        errors.append(float(np.abs(y - problem.exact(end)).max()))
    return -float(np.polyfit(np.log2(counts), np.log2(errors), 1)[0])


@pytest.mark.parametrize("problem", PROBLEMS)
@pytest.mark.parametrize("name", FIXED_STEP)
def test_measured_order_is_the_nominal_one(name: str, problem: str) -> None:
    """Within 0.15: the next term of the error bends the slope by O(h), some 0.1 at the widest step."""
    assert measured_order(name, PROBLEMS[problem]) == pytest.approx(method(name).order, abs=0.15)
