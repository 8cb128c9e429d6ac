"""Forward dynamics in O(n): the articulated-body algorithm, in body coordinates and any arithmetic.

    𝓜ᴬ = 𝓜 + Σ Adᵀ (𝓜ᴬ − U Uᵀ / d) Ad,   U = 𝓜ᴬ ξ,   d = ξᵀ U,   u_i = τ_i − ξᵀ Fᴬ
    a_i = (u_i − U_iᵀ A') / d_i  with  A' = Ad⁻¹ A_λ + c_i,   A_0 = −g

c_i is the acceleration due to the rates alone, `carried` from a parent at rest. Like A, it is the acceleration (p̈, α)
of the frame's origin, which needs fewer products than Featherstone's spatial acceleration. [Featherstone 2008, §7.3]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array, apply, rounding, symmetric
from robot_dyn.foundations.errors import QueryError, SingularError, UndecidedError
from robot_dyn.lagrange.linkage import BASE, Linkage, Step
from robot_dyn.lagrange.recursions.propagation import carried, twists, wrench


def articulated_body(linkage: Linkage, q: Array, v: Array, tau: Array) -> Array:
    """Return the acceleration a = M⁻¹ (τ − C v − N), shape (..., n).

    Args:
        linkage: Bodies without coupled joints; for these use `Lagrangian.forward_dynamics`.
        q: Positions, (..., n), numbers of the linkage's arithmetic.
        v: Velocities, (..., n).
        tau: Torques, (..., n).

    Raises:
        QueryError: If joints are coupled.
        SingularError: If a joint carries no inertia.
        UndecidedError: If rounding makes this undecidable.
    """
    if linkage.couplings.S.shape[0] != linkage.couplings.S.shape[1]:
        raise QueryError(
            "the articulated-body algorithm does not support coupled joints; use Lagrangian.forward_dynamics"
        )
    S = linkage.couplings.S  # a permutation of joints
    X = linkage.steps(q)
    batch = np.broadcast_shapes(q.shape[:-1], v.shape[:-1], tau.shape[:-1])
    v, tau = linkage.couplings.velocity(v), tau @ S.T
    bias, inertia, force = _outward(linkage, X, v, batch)

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
            remaining = symmetric(inertia[i] - U[i][..., :, None] * (U[i] / d[i])[..., None, :])
            pushed = force[i] + apply(remaining, bias[i]) + U[i] * (u[i] / d[i])
            inertia[body.parent] = inertia[body.parent] + X[i].inertia(remaining)
            force[body.parent] = force[body.parent] + X[i].wrench(pushed)

    A: list[Array] = []
    a = np.zeros((*batch, len(linkage.bodies)), dtype=linkage.gravity.dtype)
    free_fall = np.concatenate([-linkage.gravity, np.zeros_like(linkage.gravity)])
    for i, body in enumerate(linkage.bodies):
        inherited = X[i].twist(free_fall if body.parent == BASE else A[body.parent]) + bias[i]
        joint = (u[i] - apply(U[i][..., None, :], inherited)) / d[i]
        A.append(inherited + joint * body.screw)
        a[..., i] = joint[..., 0]
    return a @ S


def _outward(
    linkage: Linkage, X: list[Step], v: Array, batch: tuple[int, ...]
) -> tuple[list[Array], list[Array], list[Array]]:
    """Return for each body, base to tips: the acceleration due to rates alone, 𝓜, and the wrench that keeps ω."""
    zero = np.zeros((*batch, 6), dtype=linkage.gravity.dtype)
    V, bias, inertia, force = twists(linkage, X, v), [], [], []
    for i, body in enumerate(linkage.bodies):
        before = zero if body.parent == BASE else V[body.parent]
        bias.append(carried(body, X[i], zero, before[..., 3:], v[..., i, None]))
        inertia.append(np.broadcast_to(linkage.inertias[i], (*batch, 6, 6)))
        force.append(wrench(linkage.inertias[i], zero, V[i][..., 3:]))
    return bias, inertia, force
