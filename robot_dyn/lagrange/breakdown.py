"""The breakdown of a torque: what each link adds to τ = M a + C v + N, by inertia, Coriolis and gravity.

τ = Σ_links (J_lᵀ 𝓜_l J_l a  +  C_l v  −  J_lᵀ 𝓜_l (Rᵀ g, 0))  +  armature · a
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from robot_dyn.arithmetic import apply, transpose
from robot_dyn.lagrange.linkage import BASE
from robot_dyn.lagrange.manipulator import Lagrangian, christoffel, inertia_derivative
from robot_dyn.validate import joint_values


@final
@dataclass(frozen=True, eq=False)
class Share:
    """What one link, or the armature, adds to the torque of each joint; arrays of shape (n,), in [N m] or [N]."""

    source: str
    inertia: np.ndarray
    coriolis: np.ndarray
    gravity: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """Sum of the three."""
        return self.inertia + self.coriolis + self.gravity


def torque_breakdown(lagrangian: Lagrangian, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> tuple[Share, ...]:
    """The shares of all links that move and have mass, and of the armature; they add up to the inverse dynamics.

    Args:
        lagrangian: In a float arithmetic.
        q: Positions, (n,).
        v: Velocities, (n,).
        a: Accelerations, (n,).

    Raises:
        QueryError: If a shape is wrong or a value is not finite.
    """
    names = lagrangian.joint_names
    q, v, a = (joint_values(name, x, names, lagrangian.arithmetic) for name, x in zip("qva", (q, v, a), strict=True))
    linkage, couplings = lagrangian.linkage, lagrangian.linkage.couplings
    at, full_v, full_a = linkage.at(q), couplings.velocity(v), couplings.velocity(a)
    shares = []
    for name, (index, _, inertia) in linkage.links.items():
        if index == BASE or not np.any(inertia):
            continue
        path, J, R = list(linkage.bodies[index].path), at.jacobians[index], at.in_base[index][0]
        terms = np.zeros((3, len(linkage.bodies)), dtype=q.dtype)
        terms[0, path] = transpose(J) @ inertia @ J @ full_a[path]
        terms[1, path] = apply(christoffel(inertia_derivative(J, inertia), full_v[path]), full_v[path])
        terms[2, path] = -transpose(J) @ inertia[:, :3] @ (linkage.gravity @ R)
        shares.append(Share(name, *couplings.torque(terms)))
    if linkage.armature.any():
        zero = np.zeros(lagrangian.n, dtype=q.dtype)
        shares.append(Share("(armature)", couplings.torque(linkage.armature * full_a), zero, zero))
    return tuple(shares)
