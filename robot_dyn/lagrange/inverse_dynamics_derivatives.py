"""Derivatives of inverse dynamics τ = Σ Jᵀ F, F = 𝓜 A − ad_Vᵀ 𝓜 V, exact: ∂τ/∂q, ∂τ/∂v = 2 C, ∂τ/∂a = M.

In the axes of a body, with V_<k and A_<k its twist and acceleration due to the joints before k:

    ∂V/∂q_k = [V_<k, J_k],   ∂A/∂q_k = [A_<k, J_k] + [∂V/∂q_k, V − V_<k],   ∂J_i/∂q_k = [J_i, J_k] for i before k

∂τ/∂v = 2 C because Christoffel symbols are symmetric: ∂(C v)_i/∂v_j = 2 Σ_k Γ_ijk v_k. [Carpentier, Mansard 2018]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array, apply, transpose
from robot_dyn.foundations.spatial import bracket
from robot_dyn.lagrange.christoffel import jacobian_derivative
from robot_dyn.lagrange.linkage import Configuration
from robot_dyn.lagrange.summand import Summand, summands_of_bodies


def position_derivative(at: Configuration, v: Array, a: Array) -> Array:
    """Return ∂τ/∂q, (..., n, n)."""
    v, a, N = at.linkage.couplings.velocity(v), at.linkage.couplings.velocity(a), len(at.linkage.bodies)
    batch = np.broadcast_shapes(at.batch, v.shape[:-1], a.shape[:-1])
    total = np.zeros((*batch, N, N), dtype=at.linkage.gravity.dtype)
    for body in summands_of_bodies(at):
        entries = (..., *np.ix_(body.path, body.path))
        total[entries] = total[entries] + _of_body(body, v[..., body.path], a[..., body.path], at.linkage.gravity)
    return at.linkage.couplings.matrix(total)


def _of_body(body: Summand, v: Array, a: Array, gravity: Array) -> Array:
    """Return the terms of one body, (..., p, p), at the rates of its path."""
    J, p, inertia = body.J, body.J.shape[-1], body.inertia
    earlier = np.triu(np.ones((p, p), dtype=J.dtype), 1)
    parts = J * v[..., None, :]
    before, V = parts @ earlier, parts.sum(axis=-1)
    own = J * a[..., None, :] + _brackets(before, parts)
    fall = np.concatenate([-(gravity @ body.R), 0 * (gravity @ body.R)], axis=-1)  # A of a base at rest is −g
    A_before, A = fall[..., None] + own @ earlier, fall + own.sum(axis=-1)
    momentum, dual = apply(inertia, V), -transpose(bracket(V))
    F = apply(inertia, A) + apply(dual, momentum)
    dV = _brackets(before, J)
    dA = _brackets(A_before, J) + _brackets(dV, V[..., None] - before)
    by_twist = transpose(apply(transpose(bracket(transpose(dV))), momentum[..., None, :]))  # ad_∂Vᵀ 𝓜 V
    dF = inertia @ dA + dual @ (inertia @ dV) - by_twist
    turned = (jacobian_derivative(J) * F[..., None, None]).sum(axis=-3)  # (∂J_i/∂q_k)ᵀ F at [..., i, k]
    return turned + transpose(J) @ dF


def _brackets(X: Array, Y: Array) -> Array:
    """Return [X_k, Y_k] of columns, (..., 6, p)."""
    return transpose(apply(bracket(transpose(X)), transpose(Y)))
