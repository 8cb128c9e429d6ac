"""Derivatives of inverse dynamics: ∂τ/∂q, ∂τ/∂v = 2 C and ∂τ/∂a = M.

In the axes of body b, with V_<j and A_<j its twist and acceleration due to joints before j, and F = 𝓜 A − ad_Vᵀ 𝓜 V:

    ∂V/∂q_j = [V_<j, J_j],   ∂A/∂q_j = [A_<j, J_j] + [∂V/∂q_j, V − V_<j],   ∂J_i/∂q_j = [J_i, J_j] for i before j,
    ∂τ_i/∂q_j = Σ (∂J_i/∂q_j)ᵀ F + J_iᵀ ∂F/∂q_j

[Carpentier, Mansard 2018, in body axes: Pinocchio's own, in world axes, lose digits with the square of the distance
from the origin]
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]

from robot_dyn.foundations.arithmetic import apply
from robot_dyn.foundations.spatial import bracket
from robot_dyn.model.coriolis import columnwise_bracket, columnwise_dual
from robot_dyn.model.pinocchio_model import Built


def inverse_dynamics_derivatives(
    built: Built, data: pin.Data, q: np.ndarray, v: np.ndarray, a: np.ndarray
) -> np.ndarray:
    """Return ∂τ/∂q, ∂τ/∂v, ∂τ/∂a of all joints, (3, N, N)."""
    by_q, C = position_derivative(built, data, q, v, a), built.coriolis.matrix(data, q, v)
    return np.stack([by_q, 2 * C, pin.crba(built.model, data, q)])


def position_derivative(built: Built, data: pin.Data, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Return ∂ID/∂q of all joints, (N, N)."""
    bodies, earlier = built.coriolis.bodies, np.tri(len(q), k=-1).T
    J, inertia = bodies.jacobians(data, q), bodies.inertia
    parts, base = J * v, _free_fall(built.model, data, q)
    V, V_before = parts.sum(axis=-1), parts @ earlier
    own = J * a + columnwise_bracket(V_before, parts)
    A, A_before = base + own.sum(axis=-1), base[..., None] + own @ earlier
    momentum, dual = apply(inertia, V), -bracket(V).mT
    F = apply(inertia, A) + apply(dual, momentum)
    dV = columnwise_bracket(V_before, J)
    dA = columnwise_bracket(A_before, J) + columnwise_bracket(dV, V[..., None] - V_before)
    dF = inertia @ dA + dual @ (inertia @ dV) - columnwise_dual(dV, momentum)
    return np.triu((columnwise_dual(J, F).mT @ J).sum(axis=0), 1) + (J.mT @ dF).sum(axis=0)


def _free_fall(model: pin.Model, data: pin.Data, q: np.ndarray) -> np.ndarray:
    """Return the base's acceleration −g as a twist of each body, (N, 6)."""
    pin.forwardKinematics(model, data, q)
    g = model.gravity.linear
    return np.array([np.concatenate([-g @ placement.rotation, np.zeros(3)]) for placement in data.oMi[1:]])
