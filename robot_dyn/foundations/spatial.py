"""Rigid motions, twists and wrenches: V_b = Ad_g V_c and F_c = Ad_gᵀ F_b for g = g_bc = (R, p).

A twist is V = (v, ω) and a wrench F = (f, τ): linear part first. [Murray, Li, Sastry 1994, ch. 2]
All arguments may have leading batch axes.
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array, Scalar, cos, sin, transpose


def hat(a: Array) -> Array:
    """Return the skew matrix â with â b = a × b, shape (..., 3, 3), of a vector of shape (..., 3)."""
    result = np.zeros((*a.shape, 3), dtype=a.dtype)
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    result[..., 0, 1], result[..., 0, 2], result[..., 1, 2] = -z, y, -x
    result[..., 1, 0], result[..., 2, 0], result[..., 2, 1] = z, -y, x
    return result


def rotation(axis: Array, angle: Scalar) -> Array:
    """Return exp(â θ) = 1 + sin θ â + (1 − cos θ) â², shape (..., 3, 3), for a unit axis (3,) and angles (...).

    Source: Murray, Li, Sastry 1994, eq. 2.14 (Rodrigues' formula).
    """
    A = hat(axis)
    return rotation_about(A, A @ A, angle)


def rotation_about(A: Array, square: Array, angle: Scalar) -> Array:
    """Return `rotation` from the skew matrix â of the axis and its square, both (3, 3)."""
    theta = np.asarray(angle)[..., None, None]
    return np.eye(3, dtype=A.dtype) + sin(theta) * A + (1 - cos(theta)) * square


def rotation_rpy(rpy: Array) -> Array:
    """Return Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3), for the fixed-axis angles of a URDF, (3,)."""
    x, y, z = np.eye(3, dtype=rpy.dtype)
    return rotation(z, rpy[2]) @ rotation(y, rpy[1]) @ rotation(x, rpy[0])


def rpy_of(R: np.ndarray) -> np.ndarray:
    """Return roll, pitch and yaw of a rotation (3, 3) in float64; `rotation_rpy` maps them back to R within rounding.

    Roll is computed from Rzᵀ(yaw) R: at a pitch of ±π/2, where rounding determines the yaw, roll compensates for it.
    """
    yaw = np.arctan2(R[1, 0], R[0, 0])
    s, c = np.sin(yaw), np.cos(yaw)
    pitch = np.arctan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    return np.array([np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1]), pitch, yaw])


def adjoint(R: Array, p: Array) -> Array:
    """Return Ad_g = [[R, p̂ R], [0, R]], shape (..., 6, 6)."""
    return _upper_blocks(R, hat(p) @ R)


def adjoint_inverse(R: Array, p: Array) -> Array:
    """Return Ad_g⁻¹ = [[Rᵀ, −Rᵀ p̂], [0, Rᵀ]], shape (..., 6, 6)."""
    return _upper_blocks(transpose(R), -transpose(R) @ hat(p))


def bracket(V: Array) -> Array:
    """Return ad_V = [[ω̂, v̂], [0, ω̂]], shape (..., 6, 6), with the Lie bracket [V, W] = ad_V W.

    Source: Murray, Li, Sastry 1994, ch. 2, appendix A.
    """
    return _upper_blocks(hat(V[..., 3:]), hat(V[..., :3]))


def spatial_inertia(mass: Scalar, com: Array, inertia: Array) -> Array:
    """Return 𝓜 = [[m 1, −m ĉ], [m ĉ, I − m ĉ ĉ]], (6, 6), for centre of mass c and inertia I about it."""
    mc = mass * hat(com)
    result = np.zeros((6, 6), dtype=com.dtype)
    result[:3, :3] = mass * np.eye(3, dtype=com.dtype)
    result[:3, 3:], result[3:, :3] = -mc, mc
    result[3:, 3:] = inertia - mc @ hat(com)
    return result


def first_moment(inertia: Array) -> Array:
    """Return m c, (3,), from 𝓜, (6, 6), whose lower left block is m ĉ."""
    return inertia[(5, 3, 4), (1, 2, 0)]


def homogeneous(R: Array, p: Array) -> Array:
    """Return the matrix [[R, p], [0, 1]] of g, shape (..., 4, 4)."""
    result = np.zeros((*p.shape[:-1], 4, 4), dtype=p.dtype)
    result[..., :3, :3], result[..., :3, 3] = R, p
    result[..., 3, 3] = np.eye(1, dtype=p.dtype)[0, 0]
    return result


def block_diagonal(R: Array) -> Array:
    """Return diag(R, R), shape (..., 6, 6), which rotates both parts of a twist."""
    return _upper_blocks(R, np.zeros_like(R))


def _upper_blocks(diagonal: Array, corner: Array) -> Array:
    """Return [[D, C], [0, D]] from two blocks of shape (..., 3, 3)."""
    result = np.zeros((*diagonal.shape[:-2], 6, 6), dtype=diagonal.dtype)
    result[..., :3, :3] = result[..., 3:, 3:] = diagonal
    result[..., :3, 3:] = corner
    return result
