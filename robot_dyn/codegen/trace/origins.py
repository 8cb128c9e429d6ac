"""Origins: a body's frame may slide along its joint's axis, to where the placements of joints have the most zeros.

    D = (1, a s):   p' = p + R a s,   p_child' = p_child − a s,   𝓜' = Ad_Dᵀ 𝓜 Ad_D

D commutes with the joint's motion, so M, C and N stay the same functions of q; a zero in p saves its products in every
change of frame. That joint frames may be so chosen is what makes Denavit and Hartenberg's four numbers enough.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.spatial import adjoint
from robot_dyn.lagrange.linkage import BASE, Body, Linkage, Pose


def slid(linkage: Linkage) -> Linkage:
    """The same motion with origins where distances vanish; its links are its bodies, by the names of their joints."""
    bodies, inertias = list(linkage.bodies), list(linkage.inertias)
    for i, body in enumerate(linkage.bodies):
        children = [j for j, other in enumerate(bodies) if other.parent == i]
        p, s = _best(bodies[i], [bodies[j].pose.p for j in children])
        bodies[i] = replace(body, pose=Pose(body.pose.R, p))
        for j in children:
            bodies[j] = replace(bodies[j], pose=Pose(bodies[j].pose.R, bodies[j].pose.p - body.axis * s))
        D = adjoint(np.eye(3, dtype=p.dtype), body.axis * s)
        inertias[i] = D.T @ inertias[i] @ D
    return of_bodies(linkage, bodies, inertias)


def of_bodies(linkage: Linkage, bodies: Sequence[Body], inertias: Sequence[Array]) -> Linkage:
    """A linkage of other bodies, each with its 𝓜 (6, 6), its joints and their couplings as they are."""
    at = Pose(np.eye(3, dtype=linkage.gravity.dtype), np.zeros_like(linkage.gravity))
    links = {body.joint: (i, at, inertia) for i, (body, inertia) in enumerate(zip(bodies, inertias, strict=True))}
    return replace(linkage, bodies=tuple(bodies), links=links)


def _best(body: Body, children: Sequence[Array]) -> tuple[Array, Array]:
    """The placement p' and the slide s with the fewest numbers in this joint's and its children's placements."""
    direction, p = body.pose.R @ body.axis, body.pose.p
    choices = [(p, 0 * p[0])]
    if _numbers(direction) == 1:  # an axis of the parent; along others, origins wander off and rounding grows
        k = next(k for k in range(3) if direction[k] != 0)
        at = p.copy()
        at[k] = 0 * p[k]
        choices.insert(0, (at, -p[k] / direction[k]))  # of equals this one: zeros near the base are worth more

    def numbers(choice: tuple[Array, Array]) -> int:
        own, s = choice
        others = sum(_numbers(each - body.axis * s) for each in children)
        return others + (_numbers(own) if body.parent != BASE else 0)  # the base does not move

    return min(choices, key=numbers)


def _numbers(p: Iterable[Array]) -> int:
    """How many are not zero."""
    return sum(bool(x != 0) for x in p)
