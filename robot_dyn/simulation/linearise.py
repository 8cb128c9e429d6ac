"""Linearisation of a plant about a state: d/dt (δq, δv) = A (δq, δv) + B δu.

A = [[0, 1], [∂a/∂q, ∂a/∂v]],   B = [[0], [M⁻¹]]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.effects.plant import Plant
from robot_dyn.errors import QueryError
from robot_dyn.model.dynamics import checked

_H = 1e-3  # of Richardson's extrapolated central difference: error O(h⁴) and u/h, both about 1e-12


def linearise(plant: Plant, q: Array, v: Array, u: Array, t: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A (2n, 2n) and B (2n, n) about one state.

    Args:
        plant: What moves.
        q: Position, (n,).
        v: Velocity, (n,).
        u: Actuation, (n,).
        t: Time, in [s].

    Raises:
        QueryError: If an argument is wrong.
    """
    names, n = plant.dynamics.joint_names, plant.dynamics.n
    state = {name: checked(name, value, names) for name, value in (("q", q), ("v", v), ("u", u))}
    for name, value in state.items():
        if value.ndim != 1:
            raise QueryError(f"{name} must be one state of shape ({n},), got {value.shape}")
    x = np.concatenate(list(state.values()))

    def a(x: np.ndarray) -> np.ndarray:
        return plant.forward_dynamics(t, x[:n], x[n : 2 * n], x[2 * n :])

    slopes = np.empty((n, 3 * n))
    for i, step in enumerate(_H * np.eye(3 * n)):
        near, far = a(x + step) - a(x - step), a(x + 2 * step) - a(x - 2 * step)
        slopes[:, i] = (8 * near - far) / (12 * _H)
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:], A[n:] = np.eye(n), slopes[:, : 2 * n]
    return A, np.vstack([np.zeros((n, n)), slopes[:, 2 * n :]])
