"""Base parameters: inertia of a body that its joint's motion cannot distinguish from the parent's is moved there.

    V = Ad⁻¹ V_λ + ξ v,   K = ½ Σ Vᵀ 𝓜 V:   a δ that the motion does not change, with δ ξ = 0, moves from 𝓜 to 𝓜_λ

For a revolute joint about a, δ contains the mass, m c along a and J (1 − a aᵀ); for a prismatic joint, the second
moments. A δ that reaches the base is dropped, which changes V by a constant. M, C and N remain the same functions of q
and v; without masses on turning bodies their code is a fifth to two thirds shorter. [Gautier, Khalil 1990]
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robot_dyn.codegen.trace.origins import with_bodies
from robot_dyn.codegen.trace.symbol import Symbol
from robot_dyn.codegen.trace.symbolic import Symbols
from robot_dyn.foundations.arithmetic import Array, sqrt, symmetric
from robot_dyn.foundations.spatial import adjoint_inverse, first_moment, hat
from robot_dyn.lagrange.linkage import BASE, Body, Linkage


def regrouped(linkage: Linkage) -> Linkage:
    """Return the linkage of the same motion with fewer numbers; its links are its bodies, named after their joints."""
    inertias = list(linkage.inertias)
    for i, body in reversed(list(enumerate(linkage.bodies))):
        moved = _unchanged(body, inertias[i])
        inertias[i] = inertias[i] - moved
        if body.parent != BASE:
            X = adjoint_inverse(body.pose.R, body.pose.p)
            inertias[body.parent] = inertias[body.parent] + symmetric(X.T @ moved @ X)
    return with_bodies(linkage, linkage.bodies, inertias)


def _unchanged(body: Body, inertia: Array) -> Array:
    """Return δ, the part of a body's 𝓜 that its joint's motion neither moves nor rotates."""
    moments = inertia[3:, 3:]
    if not body.revolute:
        return _parts(0 * inertia[0, 0], 0 * body.axis, moments)
    a = body.axis
    # The lesser of two moments: the remainder is not negative, so that sums over bodies do not cancel. With the greater
    # one, the error of Kinova's M is ten times larger.
    J = _least(*(across @ moments @ across for across in _across(a)))
    return _parts(inertia[0, 0], a * (a @ first_moment(inertia)), J * (np.eye(3, dtype=a.dtype) - np.outer(a, a)))


def _least(x: Any, y: Any) -> Any:
    """Return the lesser of two numbers; of symbols (a payload's mass may be an input) the minimum is symbolic."""
    pair = np.array([x, y]).view(Symbols) if isinstance(x, Symbol) else np.array([x, y])
    return np.minimum(pair[:1], pair[1:])[0]


def _parts(mass: Array, moment: Array, rotational: Array) -> Array:
    """Return 𝓜 of a mass, a first moment m c and second moments about the frame's origin."""
    result = np.zeros((6, 6), dtype=moment.dtype)
    result[:3, :3] = mass * np.eye(3, dtype=moment.dtype)
    result[3:, :3], result[:3, 3:] = hat(moment), -hat(moment)
    result[3:, 3:] = rotational
    return result


def _across(a: Array) -> tuple[Array, Array]:
    """Return two unit vectors orthogonal to the unit vector a and to each other; axes of the frame if a is one."""
    farthest = min(range(3), key=lambda k: abs(a[k]))
    u = np.eye(3, dtype=a.dtype)[farthest] - a * a[farthest]
    u = u / sqrt(u @ u)
    return u, hat(a) @ u
