"""The breakdown of M, C and N into contributions of the links and the armature.

M = Σ M_l,  C = Σ C_l,  N = Σ N_l:   τ = Σ (M_l a + C_l v + N_l)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.validate import joint_values
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.summand import coriolis_matrix, gravity_torque, mass_matrix, summands_of_links


@final
@dataclass(frozen=True, eq=False)
class Part:
    """Contributions of one link, or of the armature, to M, C (n, n) and N (n,)."""

    source: str
    M: Array
    C: Array
    N: Array


def breakdown(lagrangian: Lagrangian, q: Array, v: Array) -> tuple[Part, ...]:
    """Return the parts of all moving links with mass, and of the armature; they add up to M, C and N.

    Args:
        lagrangian: Equations of the robot, in any arithmetic.
        q: Positions, (n,).
        v: Velocities, (n,).

    Raises:
        QueryError: If a shape is wrong or a value is not finite.
    """
    names, arithmetic = lagrangian.joint_names, lagrangian.arithmetic
    with arithmetic.scope():
        q, v = (joint_values(name, x, names, arithmetic) for name, x in (("q", q), ("v", v)))
        at, armature = lagrangian.linkage.at(q), lagrangian.linkage.armature
        parts = [(name, [summand], 0 * armature) for name, summand in summands_of_links(at)]
        if armature.any():
            parts.append(("(armature)", [], armature))
        return tuple(
            Part(name, mass_matrix(at, terms, drives), coriolis_matrix(at, terms, v), gravity_torque(at, terms))
            for name, terms, drives in parts
        )
