"""Christoffel symbols of a mass matrix Σ Jᵀ 𝓜 J, with exact derivatives from Lie brackets of the Jacobian's columns.

    ∂J_j/∂q_k = [J_j, J_k] for joint j before joint k, and 0 otherwise
    C_ij = Σ_k ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_kj/∂q_i) v_k

[Murray, Li, Sastry 1994, ch. 4 §2–3]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array, transpose
from robot_dyn.foundations.spatial import bracket


def jacobian_derivative(J: Array) -> Array:
    """Return ∂J_j/∂q_k = [J_j, J_k] for j < k, else 0, at [..., :, j, k]; J (..., 6, p) has the columns of one path."""
    p = J.shape[-1]
    brackets = bracket(transpose(J)) @ J[..., None, :, :]  # at index [..., j, :, k]
    return np.swapaxes(brackets, -3, -2) * np.triu(np.ones((p, p), dtype=J.dtype), 1)


def inertia_derivative(J: Array, inertia: Array) -> Array:
    """Return ∂(Jᵀ 𝓜 J)_ij/∂q_k at index [..., i, j, k], shape (..., p, p, p)."""
    dJ = np.moveaxis(jacobian_derivative(J), -3, -1)  # [..., i, k, :]
    half = np.swapaxes(dJ @ (inertia @ J)[..., None, :, :], -1, -2)  # ∂J_iᵀ/∂q_k 𝓜 J_j at [..., i, j, k]
    return half + np.swapaxes(half, -3, -2)


def christoffel(dM: Array, v: Array) -> Array:
    """Return C_ij = Σ_k ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_kj/∂q_i) v_k, from ∂M (..., n, n, n) and v (..., n)."""
    v = v[..., None, :, None]
    rate = (dM @ v)[..., 0]  # Ṁ
    W = (transpose(dM) @ v)[..., 0]  # W_ij = Σ_k ∂M_ik/∂q_j v_k; Wᵀ is the last term
    return (rate + W - transpose(W)) / 2
