"""Inverse dynamics in O(n): the recursive Newton–Euler algorithm, in body coordinates and any arithmetic.

    ω_i = Rᵀ ω_λ + z_i v_i,   α_i = Rᵀ α_λ + ω_i × z_i v_i + z_i a_i,   p̈_i = Rᵀ (p̈_λ + U_λ p),   p̈_0 = −g
    F_i = m p̈_i + U_i m c + Σ F_child,   N_i = I α_i + ω_i × I ω_i + m c × p̈_i + Σ (N_child + p × F_child)

U = α̂ + ω̂², z_i is the axis of a joint that turns, and τ_i = z_iᵀ N_i. Along one that slides, z_i a_i + 2 ω_i × z_i v_i
goes into p̈_i, and τ_i = z_iᵀ F_i. Linear velocities do not occur. [Luh, Walker, Paul 1980]
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robot_dyn.arithmetic import Array, apply
from robot_dyn.lagrange.linkage import BASE, Body, Linkage, Step
from robot_dyn.spatial import first_moment, hat

_Rates = tuple[Array, Array, Array]  # p̈ of the frame's origin, ω, α


def newton_euler(linkage: Linkage, q: Array, v: Array, a: Array, *, gravity: bool = True) -> Array:
    """Torque τ = M a + C v + N at one state, (n,); without gravity τ = M a + C v.

    Args:
        linkage: The bodies; joints may be coupled.
        q: Positions, (n,), numbers of the linkage's arithmetic.
        v: Velocities, (n,).
        a: Accelerations, (n,).
        gravity: Whether it acts.
    """
    X, zero = linkage.steps(q), np.zeros_like(linkage.gravity)
    position, v, a = linkage.couplings.position(q), linkage.couplings.velocity(v), linkage.couplings.velocity(a)
    free_fall = -linkage.gravity if gravity else zero
    rates, force = [], []
    for i, body in enumerate(linkage.bodies):
        before = (free_fall, zero, zero) if body.parent == BASE else rates[body.parent]
        rates.append(_moved(body, X[i], before, position[i], v[i], a[i]))
        force.append(_wrench(linkage.inertias[i], *rates[i]))
    tau = np.empty(len(linkage.bodies), dtype=linkage.gravity.dtype)
    for i, body in reversed(list(enumerate(linkage.bodies))):
        tau[i] = force[i] @ body.screw + linkage.armature[i] * a[i]
        if body.parent != BASE:
            force[body.parent] = force[body.parent] + X[i].wrench(force[i])
    return linkage.couplings.torque(tau)


def _moved(body: Body, X: Step, before: _Rates, q: Any, v: Any, a: Any) -> _Rates:
    """p̈, ω, α of a body from those of the body before it, each in its own frame."""
    (acceleration, omega, alpha), p = before, body.pose.p
    own, spun = v * body.axis, a * body.axis
    if not body.revolute:
        p = p + apply(body.pose.R, q * body.axis)
    acceleration, omega, alpha = (
        apply(X.joint[3:, 3:], apply(X.pose[3:, 3:], x))
        for x in (acceleration + apply(_spread(omega, alpha), p), omega, alpha)
    )
    if not body.revolute:
        return acceleration + 2 * apply(hat(omega), own) + spun, omega, alpha
    return acceleration, omega + own, alpha + apply(hat(omega), own) + spun


def _wrench(inertia: Array, acceleration: Array, omega: Array, alpha: Array) -> Array:
    """F = m p̈ + U (m c) and m c × p̈ + I α + ω × I ω, about the origin of the body's frame."""
    mc = first_moment(inertia)
    mass, moment, inertia = inertia[0, 0], inertia[3:, :3], inertia[3:, 3:]
    F = mass * acceleration + apply(_spread(omega, alpha), mc)
    return np.concatenate(
        [F, apply(moment, acceleration) + apply(inertia, alpha) + apply(hat(omega), apply(inertia, omega))]
    )


def _spread(omega: Array, alpha: Array) -> Array:
    """U = α̂ + ω̂²: a point r of the body is accelerated by U r against its origin."""
    return hat(alpha) + hat(omega) @ hat(omega)


def kinetic_energy(linkage: Linkage, q: Array, v: Array) -> Array:
    """K = ½ Σ V_iᵀ 𝓜_i V_i at one state, a number; arguments as of `newton_euler`."""
    v = linkage.couplings.velocity(v)
    K = linkage.armature @ (v * v)
    for V, inertia in zip(_twists(linkage, linkage.steps(q), v), linkage.inertias, strict=True):
        K = K + V @ apply(inertia, V)
    return K / 2


def _twists(linkage: Linkage, X: list[Step], v: Array) -> list[Array]:
    """V of each body, base to tips."""
    twists: list[Array] = []
    for i, body in enumerate(linkage.bodies):
        own = v[i] * body.screw
        twists.append(own if body.parent == BASE else X[i].twist(twists[body.parent]) + own)
    return twists
