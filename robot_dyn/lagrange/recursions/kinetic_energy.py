"""Kinetic energy in O(n): the sum over the bodies, each with its own twist.

K = ½ Σ V_iᵀ 𝓜_i V_i  +  ½ Σ armature · v²
"""

from __future__ import annotations

from robot_dyn.foundations.arithmetic import Array, apply
from robot_dyn.lagrange.linkage import Linkage
from robot_dyn.lagrange.recursions.propagation import twists


def kinetic_energy(linkage: Linkage, q: Array, v: Array) -> Array:
    """K = ½ Σ V_iᵀ 𝓜_i V_i at one state, a number; arguments as of `newton_euler`."""
    v = linkage.couplings.velocity(v)
    K = linkage.armature @ (v * v)
    for V, inertia in zip(twists(linkage, linkage.steps(q), v), linkage.inertias, strict=True):
        K = K + V @ apply(inertia, V)
    return K / 2
