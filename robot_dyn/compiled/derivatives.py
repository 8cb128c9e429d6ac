"""Derivatives of forward dynamics by Pinocchio: ∂a/∂q = −M⁻¹ ∂ID/∂q, ∂a/∂v = −M⁻¹ ∂ID/∂v, ∂a/∂τ = M⁻¹, tied joints too.

[Carpentier, Mansard 2018]
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]

from robot_dyn.arithmetic import Array
from robot_dyn.model.dynamics import check_batches
from robot_dyn.model.robot import Robot


def forward_dynamics_derivatives(robot: Robot, q: Array, v: Array, tau: Array) -> np.ndarray:
    """The three derivatives, (..., 3, n, n).

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


def _one(robot: Robot, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Any:
    ties, model = robot.ties, robot.model
    full = ties.position(q), ties.velocity(v), ties.velocity(a)
    data = model.createData()  # to be kept: what comes back is its memory
    by_q, by_v, _ = pin.computeRNEADerivatives(model, data, *full)
    columns = [-ties.matrix(by_q), -ties.matrix(by_v), np.eye(robot.n)]
    return np.linalg.solve(robot.M(q)[None], np.stack(columns))
