"""The regressor by recursion: Newton–Euler equations of bodies with one unit parameter each.

    Y_jk = ξ_jᵀ Ad⁻ᵀ … wrench(E_k, A_i, ω_i)   for joint j on the path to body i,   0 otherwise

[Atkeson, An, Hollerbach 1986; Siciliano et al. 2009, §7.2.2]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.description.inertial_parameters import unit_inertias
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.lagrange.linkage import Linkage
from robot_dyn.lagrange.recursions.propagation import accelerations, twists, wrench


def regressor(linkage: Linkage, q: Array, v: Array, a: Array) -> Array:
    """Return Y at one state, (n, 10 N), with τ = Y θ + armature · a; bodies in the order of the linkage's parameters.

    Args:
        linkage: The bodies; only their frames are used. Joints may be coupled.
        q: Positions, (n,), numbers of the linkage's arithmetic.
        v: Velocities, (n,).
        a: Accelerations, (n,).
    """
    X, v, a = linkage.steps(q), linkage.couplings.velocity(v), linkage.couplings.velocity(a)
    V = twists(linkage, X, v)
    A = accelerations(linkage, X, V, v, a, np.concatenate([-linkage.gravity, np.zeros_like(linkage.gravity)]))
    N, units = len(linkage.bodies), unit_inertias(linkage.gravity.dtype)
    Y = np.zeros((N, N, len(units)), dtype=linkage.gravity.dtype)  # by joint, body and parameter
    for i, body in enumerate(linkage.bodies):
        F = np.stack([wrench(unit, A[i], V[i][3:]) for unit in units])
        for j in reversed(body.path):
            Y[j, i] = F @ linkage.bodies[j].screw
            F = X[j].wrench(F)
    return linkage.couplings.rows(Y[:, linkage.order].reshape(N, -1))
