"""Derivatives of f(t, y) by differences, in float32 and float64.

    ∂f/∂y_j ≈ (f(t, y + s e_j) − f(t, y − s e_j)) / 2 s

Truncation and rounding error are both about u^(2/3). [Dennis, Schnabel, Numerical Methods for Unconstrained
Optimization, 1983, 5.4]
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.foundations.arithmetic import Array, Scalar

INSIDE = 0.01  # fraction of a width: the central difference of tanh is off by 3e-5; Newton's iteration corrects it
_MIN_SPAN = 64  # units in the last place of an entry

Rate = Callable[[Scalar, Array], Array]  # f(t, y)


def rowwise(function: Callable[[Array], ArrayLike]) -> Rate:
    """Return a function of time and states (…, m), with results (…, k), from a function of one state (m,).

    The result does not depend on the time.
    """

    def f(t: Scalar, states: Array) -> Array:
        results = [np.asarray(function(row), dtype=float) for row in states.reshape(-1, states.shape[-1])]
        return np.array(results).reshape(*states.shape[:-1], -1)

    return f


def by_state(f: Rate, t: Scalar, y: Array, widths: Array | None = None) -> Array:
    """Return ∂f/∂y_j for each j, (m, ..., m), from 2 m evaluations in one batch.

    Args:
        f: Function of a time and states (..., m).
        t: Time.
        y: State, shape (..., m), float32 or float64. The scale of an entry is max(1, |y|), or `widths` if smaller.
        widths: Widths over which the rate bends, (m,); see `System`.
    """
    m = y.shape[-1]
    unit = np.eye(m, dtype=y.dtype).reshape(m, *(1,) * (y.ndim - 1), m)  # axis 0: the entry that is moved
    u, size = np.finfo(y.dtype).eps, np.maximum(1, np.abs(y))
    span = np.cbrt(u) * size
    if widths is not None:
        span = np.maximum(np.minimum(span, INSIDE * widths), _MIN_SPAN * u * np.abs(y)).astype(y.dtype)
    shift = unit * span
    moved = np.stack([y + shift, y - shift])
    width = (moved[0] - moved[1]).sum(axis=-1, keepdims=True)  # as rounded, not 2 × shift; all other entries are 0
    up, down = f(t, moved)
    return (up - down) / width


def by_time(f: Rate, t: Scalar, y: Array, end: Scalar) -> Array:
    """Return ∂f/∂t, (..., m), from 3 evaluations at t and between t and `end`, where f is smooth."""
    scale = np.cbrt(np.finfo(y.dtype).eps) * max(1.0, abs(float(t)))
    span = min(scale, abs(float(end) - float(t)) / 2)
    near = t + y.dtype.type(np.copysign(span, float(end) - float(t)))
    far = near + (near - t)
    if far == t:
        return np.zeros_like(y)
    now, next_, last = (f(at, y) for at in (t, near, far))
    return (4 * next_ - last - 3 * now) / (far - t)
