"""Kinetic energy in O(n): the sum over the bodies by their twists.

K = ½ Σ V_iᵀ 𝓜_i V_i  +  ½ Σ armature · v²
"""

from __future__ import annotations

from robot_dyn.foundations.arithmetic import Array, apply
from robot_dyn.lagrange.linkage import Linkage
from robot_dyn.lagrange.recursions.propagation import twists


def kinetic_energy(linkage: Linkage, q: Array, v: Array) -> Array:
    """Return K = ½ Σ V_iᵀ 𝓜_i V_i + ½ Σ armature · v² at one state, a number.

    Args:
        linkage: The bodies; joints may be coupled.
        q: Positions, (n,), numbers of the linkage's arithmetic.
        v: Velocities, (n,).
    """
    v = linkage.couplings.velocity(v)
    K = linkage.armature @ (v * v)
    for V, inertia in zip(twists(linkage, linkage.steps(q), v), linkage.inertias, strict=True):
        K = K + V @ apply(inertia, V)
    return K / 2
