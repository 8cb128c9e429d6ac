"""Derivatives of forward dynamics: ∂a/∂q = −M⁻¹ ∂ID/∂q, ∂a/∂v = −M⁻¹ ∂ID/∂v, ∂a/∂τ = M⁻¹, coupled joints included."""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.validate import check_batches
from robot_dyn.model.robot import Robot


def forward_dynamics_derivatives(robot: Robot, q: Array, v: Array, tau: Array) -> np.ndarray:
    """Return the three derivatives, (..., 3, n, n).

    Raises:
        QueryError: If an argument is wrong.
        SingularError: If M is singular.
    """
    a = robot.forward_dynamics(q, v, tau)
    arrays = [np.asarray(x, dtype=float) for x in (q, v, a)]
    batch, n = check_batches(q=arrays[0], v=arrays[1], a=arrays[2]), robot.n
    rows = [np.broadcast_to(x, (*batch, n)).reshape(-1, n) for x in arrays]
    result = np.empty((len(rows[0]), 3, n, n))
    for i, state in enumerate(zip(*rows, strict=True)):
        result[i] = _one(robot, *state)
    return result.reshape(*batch, 3, n, n)


def _one(robot: Robot, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    by_q, by_v, M = robot.inverse_dynamics_derivatives(q, v, a)
    return np.linalg.solve(M[None], np.stack([-by_q, -by_v, np.eye(robot.n)]))
