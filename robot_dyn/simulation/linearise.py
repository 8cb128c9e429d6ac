"""Linearisation of a plant about a state: d/dt (δq, δv) = A (δq, δv) + B δu.

A = [[0, 1], [∂a/∂q, ∂a/∂v]],   B = [[0], [M⁻¹]]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.effects.plant import Plant
from robot_dyn.errors import QueryError
from robot_dyn.model.dynamics import checked

_STEPS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # of Richardson's extrapolated central difference: error O(h⁴) and u/h
_KINK = 0.01  # of a slope: more between its two sides is no curvature at the shortest step
_NO_DERIVATIVE = "the plant has no derivative at this state, such as at an effort limit or a stop; move the state"
_AGREE = 1e-6  # of the largest slope: two steps that differ by more do not show a derivative


def linearise(plant: Plant, q: Array, v: Array, u: Array, t: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A (2n, 2n) and B (2n, n) about one state.

    Args:
        plant: What moves.
        q: Position, (n,).
        v: Velocity, (n,).
        u: Actuation, (n,).
        t: Time, in [s].

    Raises:
        QueryError: If an argument is wrong, or the plant has a kink at this state.
    """
    names, n = plant.dynamics.joint_names, plant.dynamics.n
    state = {name: checked(name, value, names) for name, value in (("q", q), ("v", v), ("u", u))}
    for name, value in state.items():
        if value.ndim != 1:
            raise QueryError(f"{name} must be one state of shape ({n},), got {value.shape}")
    x = np.concatenate(list(state.values()))

    def a(x: np.ndarray) -> np.ndarray:
        return plant.forward_dynamics(t, x[:n], x[n : 2 * n], x[2 * n :])

    def differences(h: float) -> np.ndarray:
        slopes = np.empty((n, 3 * n))
        for i, step in enumerate(h * np.eye(3 * n)):
            near, far = a(x + step) - a(x - step), a(x + 2 * step) - a(x - 2 * step)
            slopes[:, i] = (8 * near - far) / (12 * h)
        return slopes

    slopes, rest = differences(_STEPS[0]), list(_STEPS[1:])
    while rest:  # steep friction needs a short step; the longest one that a shorter one confirms errs least
        shorter = differences(rest.pop(0))
        if np.abs(shorter - slopes).max() <= _AGREE * np.abs(shorter).max():
            break
        slopes = shorter
    else:
        raise QueryError(_NO_DERIVATIVE)
    h, here = _STEPS[-1], a(x)
    for i, step in enumerate(h * np.eye(3 * n)):  # at a kink the two sides differ, though their mean does not
        if np.abs(a(x + step) + a(x - step) - 2 * here).max() > _KINK * h * np.abs(slopes[:, i]).max() + 1e-9:
            raise QueryError(_NO_DERIVATIVE)
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:], A[n:] = np.eye(n), slopes[:, : 2 * n]
    return A, np.vstack([np.zeros((n, n)), slopes[:, 2 * n :]])
