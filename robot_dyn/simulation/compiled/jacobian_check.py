"""The Jacobian of machine code beside differences of the interpreted state equation, at one state.

Two spans tell by how much differences may be off themselves: by rounding, or where a kink lies between.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.integrate.differences import INSIDE, by_state, by_time
from robot_dyn.simulation.dynamics.state_equation import StateEquation

DIFFERENCES = 1e-6  # of a column: differences are right to some 1e-10 of f, over columns of other units
_NARROWER = 4.0
_DOUBT, _ROUNDINGS = 30.0, 300.0  # of f, where forces cancel


def by_differences(equation: StateEquation, t: float, y: Array, held: Array | None, p: Array, J: Array) -> float:
    """How far a Jacobian is from differences, in parts of what is allowed: 1 or less if it agrees.

    Args:
        equation: The interpreted state equation.
        t: Time within the segment.
        y: State, (m,).
        held: The actuation in zero-order hold, or None.
        p: Of the segment.
        J: ∂f/∂y_j for each j, then ∂f/∂t, (m + 1, m).
    """

    def f(at: Any, states: Array) -> Array:
        time = min(max(float(at), p[0]), p[1])
        rows = states.reshape(-1, equation.size)
        return np.array([equation.rate(time, row, held)[0] for row in rows]).reshape(states.shape)

    span = np.cbrt(np.finfo(float).eps)
    widths, ahead = np.minimum(equation.widths, span * np.maximum(1.0, np.abs(y)) / INSIDE), 2 * span * max(1.0, abs(t))
    ahead = min(ahead, p[1] - t) if t - p[0] < p[1] - t else max(-ahead, p[0] - t)
    wide, narrow = (
        np.vstack([by_state(f, t, y, scale * widths), by_time(f, t, y, t + scale * ahead)[None]])
        for scale in (1.0, 1 / _NARROWER)
    )
    rounding = _ROUNDINGS * np.finfo(float).eps * np.abs(f(t, y)).max() / span
    doubt = _DOUBT * np.abs(wide - narrow).max(axis=1) + rounding
    allowed = DIFFERENCES * np.maximum(1.0, np.abs(narrow).max(axis=1)) + doubt
    far = np.abs(J - wide).max(axis=1)
    return float((far / allowed).max()) if np.isfinite(J).all() else np.inf
