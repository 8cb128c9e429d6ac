"""Derivatives of f(t, y) by differences, in float32 and float64.

    ∂f/∂y_j ≈ (f(t, y + s e_j) − f(t, y − s e_j)) / 2 s

The error is about u^(2/3), of truncation and rounding alike. [Dennis, Schnabel, Numerical Methods for Unconstrained
Optimization, 1983, 5.4]
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from robot_dyn.foundations.arithmetic import Array

INSIDE = 0.01  # of a width: a central difference of tanh is then off by 3e-5, which Newton's iteration corrects
_LEAST = 64  # units in the last place of an entry that a difference spans at least

Rate = Callable[[Any, Array], Array]


def rowwise(function: Callable[[Array], Any]) -> Rate:
    """A function of one state (m,), which returns k numbers, as one of a time and states (…, m), which returns (…, k).

    It does not depend on the time.
    """

    def f(t: Any, states: Array) -> Array:
        results = [np.asarray(function(row), dtype=float) for row in states.reshape(-1, states.shape[-1])]
        return np.array(results).reshape(*states.shape[:-1], -1)

    return f


def by_state(f: Rate, t: Any, y: Array, widths: Array | None = None) -> Array:
    """∂f/∂y_j for each j, (m, ..., m), from 2 m evaluations in one batch.

    Args:
        f: Of a time and states (..., m).
        t: Time.
        y: State, shape (..., m), float32 or float64. Entries are taken to vary on a scale of max(1, |y|), or on that
            of `widths` where it is narrower.
        widths: As of `System`.
    """
    m = y.shape[-1]
    unit = np.eye(m, dtype=y.dtype).reshape(m, *(1,) * (y.ndim - 1), m)  # axis 0: the entry that is moved
    u, size = np.finfo(y.dtype).eps, np.maximum(1, np.abs(y))
    span = np.cbrt(u) * size
    if widths is not None:
        span = np.maximum(np.minimum(span, INSIDE * widths), _LEAST * u * np.abs(y)).astype(y.dtype)
    shift = unit * span
    both = np.stack([y + shift, y - shift])
    width = (both[0] - both[1]).sum(axis=-1, keepdims=True)  # as rounded, not 2 × shift; all other entries are 0
    up, down = f(t, both)
    return (up - down) / width


def by_time(f: Rate, t: Any, y: Array, end: Any) -> Array:
    """∂f/∂t, (..., m), from 3 evaluations at t and between t and `end`, where f is smooth."""
    scale = np.cbrt(np.finfo(y.dtype).eps) * max(1.0, abs(float(t)))
    span = min(scale, abs(float(end) - float(t)) / 2)
    near = t + y.dtype.type(np.copysign(span, float(end) - float(t)))
    far = near + (near - t)
    if far == t:
        return np.zeros_like(y)
    now, next_, last = (f(at, y) for at in (t, near, far))
    return (4 * next_ - last - 3 * now) / (far - t)
