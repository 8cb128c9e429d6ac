"""Derivatives of forward dynamics: ∂a/∂q = −M⁻¹ ∂ID/∂q, ∂a/∂v = −M⁻¹ ∂ID/∂v, ∂a/∂τ = M⁻¹, coupled joints included.

In the axes of body b, with V_<j and A_<j its twist and acceleration due to joints before j, and F = 𝓜 A − ad_Vᵀ 𝓜 V:

    ∂V/∂q_j = [V_<j, J_j],   ∂A/∂q_j = [A_<j, J_j] + [∂V/∂q_j, V − V_<j],   ∂J_i/∂q_j = [J_i, J_j] for i before j,
    ∂ID_i/∂q_j = Σ (∂J_i/∂q_j)ᵀ F + J_iᵀ ∂F/∂q_j,   ∂ID/∂v = 2 C

[Carpentier, Mansard 2018, in body axes: Pinocchio's own, in world axes, lose digits with the square of the distance
from the origin]
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]

from robot_dyn.foundations.arithmetic import Array, apply
from robot_dyn.foundations.spatial import bracket
from robot_dyn.foundations.validate import check_batches
from robot_dyn.model.coriolis import columnwise_bracket, columnwise_dual
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
    couplings = robot.couplings
    by_q = couplings.matrix(_by_position(robot, couplings.position(q), couplings.velocity(v), couplings.velocity(a)))
    columns = [-by_q, -2 * robot.C(q, v), np.eye(robot.n)]
    return np.linalg.solve(robot.M(q)[None], np.stack(columns))


def _by_position(robot: Robot, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Return ∂ID/∂q of all joints, (N, N)."""
    data, inertia = robot.model.createData(), robot.coriolis.bodies.inertia
    J, earlier = robot.coriolis.bodies.jacobians(data, q), np.tri(len(q), k=-1).T
    parts, base = J * v, _free_fall(robot, data, q)
    V, V_before = parts.sum(axis=-1), parts @ earlier
    own = J * a + columnwise_bracket(V_before, parts)
    A, A_before = base + own.sum(axis=-1), base[..., None] + own @ earlier
    momentum, dual = apply(inertia, V), -bracket(V).mT
    F = apply(inertia, A) + apply(dual, momentum)
    dV = columnwise_bracket(V_before, J)
    dA = columnwise_bracket(A_before, J) + columnwise_bracket(dV, V[..., None] - V_before)
    dF = inertia @ dA + dual @ (inertia @ dV) - columnwise_dual(dV, momentum)
    return np.triu((columnwise_dual(J, F).mT @ J).sum(axis=0), 1) + (J.mT @ dF).sum(axis=0)


def _free_fall(robot: Robot, data: Any, q: np.ndarray) -> np.ndarray:
    """Return the base's acceleration −g as a twist of each body, (N, 6)."""
    pin.forwardKinematics(robot.model, data, q)
    g = robot.model.gravity.linear
    return np.array([np.concatenate([-g @ placement.rotation, np.zeros(3)]) for placement in data.oMi[1:]])
