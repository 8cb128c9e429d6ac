"""The mass matrix in O(n · depth): the composite-rigid-body algorithm in body coordinates and any arithmetic.

    𝓜ᶜ_i = 𝓜_i + Σ Ad⁻ᵀ 𝓜ᶜ_child Ad⁻¹,   M_ij = ξ_jᵀ (Ad⁻ᵀ … 𝓜ᶜ_i ξ_i) for j before i

[Featherstone 2008, §6.2]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array, apply
from robot_dyn.lagrange.linkage import BASE, Linkage


def composite_body(linkage: Linkage, q: Array) -> Array:
    """Return the mass matrix M at one configuration, (n, n).

    Args:
        linkage: The bodies; joints may be coupled.
        q: Positions, (n,), in the arithmetic of the linkage.
    """
    X, inertia = linkage.steps(q), list(linkage.inertias)
    N = len(linkage.bodies)
    M = np.zeros((N, N), dtype=linkage.gravity.dtype)
    for i, body in reversed(list(enumerate(linkage.bodies))):
        if body.parent != BASE:
            inertia[body.parent] = inertia[body.parent] + X[i].inertia(inertia[i])
        F = apply(inertia[i], body.screw)
        M[i, i] = F @ body.screw + linkage.armature[i]
        for j, below in zip(body.path[-2::-1], body.path[:0:-1], strict=True):
            F = X[below].wrench(F)
            M[i, j] = M[j, i] = F @ linkage.bodies[j].screw
    return linkage.couplings.matrix(M)
