"""Propagation of velocity and acceleration from body to body, base to tips: the outward half of every recursion.

    V_i = Ad⁻¹ V_λ + ξ_i v_i,   V = (ṗ, ω) of the origin of the body's frame, in its axes
    α_i = Rᵀ α_λ + ω_i × z_i v_i + z_i a_i,   p̈_i = Rᵀ (p̈_λ + (α̂_λ + ω̂_λ²) p)

with z_i the axis of a revolute joint. For a prismatic joint, 2 ω_i × z_i v_i + z_i a_i is added to p̈_i instead of α_i.
Accelerations A = (p̈, α) are those of the origin, not spatial ones: they do not depend on linear velocities, which
saves products. [Luh, Walker, Paul 1980; Craig 2005, §5.6 and §6.5]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array, apply
from robot_dyn.foundations.spatial import first_moment, hat
from robot_dyn.lagrange.linkage import BASE, Body, Linkage, Step


def twists(linkage: Linkage, steps: list[Step], v: Array) -> list[Array]:
    """Return V of each body, (..., 6), from the rates of all joints, v (..., N)."""
    V: list[Array] = []
    for i, body in enumerate(linkage.bodies):
        relative = v[..., i, None] * body.screw
        V.append(relative if body.parent == BASE else steps[i].twist(V[body.parent]) + relative)
    return V


def accelerations(linkage: Linkage, steps: list[Step], V: list[Array], v: Array, a: Array, base: Array) -> list[Array]:
    """Return A of each body, (..., 6), from `twists`, rates v and a (..., N) of all joints and A of the base, (6,)."""
    A: list[Array] = []
    for i, body in enumerate(linkage.bodies):
        before, twist = (base, 0 * base) if body.parent == BASE else (A[body.parent], V[body.parent])
        A.append(carried(body, steps[i], before, twist[..., 3:], v[..., i, None]) + a[..., i, None] * body.screw)
    return A


def carried(body: Body, step: Step, A: Array, omega: Array, v: Array) -> Array:
    """Return A (..., 6) of a body at constant joint rate v (..., 1), from the parent's A (..., 6) and ω (..., 3)."""
    origin = step.rotated(A[..., :3] + apply(_spread(omega, A[..., 3:]), step.origin))
    alpha = step.rotated(A[..., 3:])
    product = apply(hat(step.rotated(omega)), v * body.axis)
    return np.concatenate([origin, alpha + product] if body.revolute else [origin + 2 * product, alpha], axis=-1)


def wrench(inertia: Array, A: Array, omega: Array) -> Array:
    """Return m p̈ + U m c and m c × p̈ + I α + ω × I ω about the frame's origin, (..., 6), of a body with 𝓜 (6, 6)."""
    mc, mass, moment, inertia = first_moment(inertia), inertia[0, 0], inertia[3:, :3], inertia[3:, 3:]
    F = mass * A[..., :3] + apply(_spread(omega, A[..., 3:]), mc)
    turning = apply(inertia, A[..., 3:]) + apply(hat(omega), apply(inertia, omega))
    return np.concatenate([F, apply(moment, A[..., :3]) + turning], axis=-1)


def _spread(omega: Array, alpha: Array) -> Array:
    """Return U = α̂ + ω̂²: a point r of the body has the acceleration U r relative to its origin."""
    return hat(alpha) + hat(omega) @ hat(omega)
