"""Forward dynamics in O(n): the articulated-body algorithm, in body coordinates and any arithmetic.

    V_i = Ad⁻¹ V_λ + ξ_i v_i,   c_i = [V_i, ξ_i v_i],   𝓜ᴬ = 𝓜 + Σ Adᵀ (𝓜ᴬ − U Uᵀ / d) Ad,   U = 𝓜ᴬ ξ,   d = ξᵀ U
    a_i = (u_i − U_iᵀ A') / d_i  with  A' = Ad⁻¹ A_λ + c_i,   u_i = τ_i − ξᵀ Fᴬ,   A_0 = −g

[Featherstone 2008, §7.3]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.arithmetic import Array, apply, rounding, symmetric, transpose
from robot_dyn.errors import QueryError, SingularError, UndecidedError
from robot_dyn.lagrange.linkage import BASE, Linkage, Step
from robot_dyn.spatial import bracket


def articulated_body(linkage: Linkage, q: Array, v: Array, tau: Array) -> Array:
    """Acceleration a = M⁻¹ (τ − C v − N), shape (..., n).

    Args:
        linkage: Its joints must not be coupled; `Lagrangian.forward_dynamics` takes those that are.
        q: Positions, (..., n), numbers of the linkage's arithmetic.
        v: Velocities, (..., n).
        tau: Torques, (..., n).

    Raises:
        QueryError: If joints are coupled.
        SingularError: If a joint carries no inertia; UndecidedError if rounding hides whether it does.
    """
    if linkage.couplings.S.shape[0] != linkage.couplings.S.shape[1]:
        raise QueryError("the articulated-body algorithm takes no coupled joints; use Lagrangian.forward_dynamics")
    S = linkage.couplings.S  # at most an exchange of joints
    X = linkage.steps(q)
    batch = np.broadcast_shapes(q.shape[:-1], v.shape[:-1], tau.shape[:-1])
    v, tau = linkage.couplings.velocity(v), tau @ S.T
    coriolis, inertia, force = _outward(linkage, X, v, batch)

    U, d, u = {}, {}, {}
    for i, body in reversed(list(enumerate(linkage.bodies))):
        U[i] = apply(inertia[i], np.broadcast_to(body.screw, (*batch, 6)))
        d[i] = U[i][..., None, :] @ body.screw + linkage.armature[i]
        if not np.all(d[i] > 0):
            if np.any(d[i] < 0) or np.all(U[i] == 0):
                raise SingularError(body.joint, "at this q")
            raise UndecidedError(body.joint, "at this q", rounding(d[i]))
        u[i] = tau[..., i, None] - force[i][..., None, :] @ body.screw
        if body.parent != BASE:
            left = symmetric(inertia[i] - U[i][..., :, None] * (U[i] / d[i])[..., None, :])
            pushed = force[i] + apply(left, coriolis[i]) + U[i] * (u[i] / d[i])
            inertia[body.parent] = inertia[body.parent] + X[i].inertia(left)
            force[body.parent] = force[body.parent] + X[i].wrench(pushed)

    acceleration: list[Array] = []
    a = np.zeros((*batch, len(linkage.bodies)), dtype=linkage.gravity.dtype)
    free_fall = np.concatenate([-linkage.gravity, np.zeros_like(linkage.gravity)])
    for i, body in enumerate(linkage.bodies):
        carried = X[i].twist(free_fall if body.parent == BASE else acceleration[body.parent]) + coriolis[i]
        own = (u[i] - apply(U[i][..., None, :], carried)) / d[i]
        acceleration.append(carried + own * body.screw)
        a[..., i] = own[..., 0]
    return a @ S


def _outward(
    linkage: Linkage, X: list[Step], v: Array, batch: tuple[int, ...]
) -> tuple[list[Array], list[Array], list[Array]]:
    """For each body c = [V, ξ v], 𝓜, and the bias wrench −ad_Vᵀ 𝓜 V, base to tips."""
    twist, coriolis, inertia, force = [], [], [], []
    for i, body in enumerate(linkage.bodies):
        own = v[..., i, None] * body.screw
        V = np.broadcast_to(own if body.parent == BASE else X[i].twist(twist[body.parent]) + own, (*batch, 6))
        twist.append(V)
        coriolis.append(apply(bracket(V), own))
        inertia.append(np.broadcast_to(linkage.inertias[i], (*batch, 6, 6)))
        force.append(-apply(transpose(bracket(V)), apply(linkage.inertias[i], V)))
    return coriolis, inertia, force
