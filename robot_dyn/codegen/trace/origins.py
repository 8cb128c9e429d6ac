"""Origins: a body's frame may slide along its joint's axis, to where the placements of joints have the most zeros.

    D = (1, a s):   p' = p + R a s,   p_child' = p_child − a s,   𝓜' = Ad_Dᵀ 𝓜 Ad_D

D commutes with the joint's motion, so M, C and N remain the same functions of q; a zero in p saves its products in
every change of frame. Because of this freedom, Denavit and Hartenberg's four numbers suffice.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.spatial import adjoint
from robot_dyn.lagrange.linkage import BASE, Body, Linkage, Pose


def slid(linkage: Linkage) -> Linkage:
    """Return the same motion with origins where distances vanish; links are bodies, named after their joints."""
    bodies, inertias = list(linkage.bodies), list(linkage.inertias)
    for i, body in enumerate(linkage.bodies):
        children = [j for j, other in enumerate(bodies) if other.parent == i]
        p, s = _best(bodies[i], [bodies[j].pose.p for j in children])
        bodies[i] = replace(body, pose=Pose(body.pose.R, p))
        for j in children:
            bodies[j] = replace(bodies[j], pose=Pose(bodies[j].pose.R, bodies[j].pose.p - body.axis * s))
        D = adjoint(np.eye(3, dtype=p.dtype), body.axis * s)
        inertias[i] = D.T @ inertias[i] @ D
    return with_bodies(linkage, bodies, inertias)


def with_bodies(linkage: Linkage, bodies: Sequence[Body], inertias: Sequence[Array]) -> Linkage:
    """Return a linkage with other bodies, each with its 𝓜 (6, 6), and the same joints and couplings."""
    at = Pose(np.eye(3, dtype=linkage.gravity.dtype), np.zeros_like(linkage.gravity))
    links = {body.joint: (i, at, inertia) for i, (body, inertia) in enumerate(zip(bodies, inertias, strict=True))}
    return replace(linkage, bodies=tuple(bodies), links=links)


def _best(body: Body, children: Sequence[Array]) -> tuple[Array, Array]:
    """Return the placement and slide with the fewest nonzero numbers in placements of this joint and its children."""
    direction, p = body.pose.R @ body.axis, body.pose.p
    choices = [(p, 0 * p[0])]
    if _numbers(direction) == 1:  # along other directions, origins drift away and rounding grows
        k = next(k for k in range(3) if direction[k] != 0)
        at = p.copy()
        at[k] = 0 * p[k]
        choices.insert(0, (at, -p[k] / direction[k]))  # first, to win ties: zeros near the base save more

    def numbers(choice: tuple[Array, Array]) -> int:
        own, s = choice
        others = sum(_numbers(child - body.axis * s) for child in children)
        return others + (_numbers(own) if body.parent != BASE else 0)  # the base is fixed

    return min(choices, key=numbers)


def _numbers(p: Iterable[Array]) -> int:
    """Return the number of nonzero entries."""
    return sum(bool(x != 0) for x in p)
