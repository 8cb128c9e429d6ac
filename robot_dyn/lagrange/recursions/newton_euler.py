"""Inverse dynamics in O(n): the recursive Newton–Euler algorithm, in body coordinates and any arithmetic.

    outward    V_i, A_i = carried + ξ_i a_i,  A_0 = −g;   inward    F_i = wrench + Σ Ad⁻ᵀ F_child,   τ_i = ξ_iᵀ F_i

[Luh, Walker, Paul 1980]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.lagrange.linkage import BASE, Linkage
from robot_dyn.lagrange.recursions.propagation import accelerations, twists, wrench


def newton_euler(linkage: Linkage, q: Array, v: Array, a: Array, *, gravity: bool = True) -> Array:
    """Return the torque τ = M a + C v + N at one state, (n,); without gravity τ = M a + C v.

    Args:
        linkage: The bodies; joints may be coupled.
        q: Positions, (n,), numbers of the linkage's arithmetic.
        v: Velocities, (n,).
        a: Accelerations, (n,).
        gravity: Include gravity.
    """
    X, v, a = linkage.steps(q), linkage.couplings.velocity(v), linkage.couplings.velocity(a)
    zero = np.zeros_like(linkage.gravity)
    V = twists(linkage, X, v)
    A = accelerations(linkage, X, V, v, a, np.concatenate([-linkage.gravity if gravity else zero, zero]))
    bodies = zip(linkage.inertias, A, V, strict=True)
    force = [wrench(inertia, rate, twist[3:]) for inertia, rate, twist in bodies]
    tau = np.empty(len(linkage.bodies), dtype=linkage.gravity.dtype)
    for i, body in reversed(list(enumerate(linkage.bodies))):
        tau[i] = force[i] @ body.screw + linkage.armature[i] * a[i]
        if body.parent != BASE:
            force[body.parent] = force[body.parent] + X[i].wrench(force[i])
    return linkage.couplings.torque(tau)
