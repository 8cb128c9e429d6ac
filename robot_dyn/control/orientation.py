"""Orientation error: the rotation vector φ of R = exp(φ̂), φ = θ a with 0 ≤ θ ≤ π.

[Murray, Li, Sastry 1994, sec. 2.2; Siciliano et al. 2009, sec. 3.7.3]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.arithmetic import Array, sqrt, transpose


def rotation_vector(R: Array) -> Array:
    """Logarithm of a rotation, φ with exp(φ̂) = R: accurate from no turn to half a turn.

    It goes through the unit quaternion (w, x): θ = 2 atan2(‖x‖, |w|), which loses no digits where the textbook's
    (R − Rᵀ)θ/(2 sin θ) is 0/0. At exactly half a turn φ and −φ are the same rotation; one of them is returned.

    Args:
        R: Shape (..., 3, 3).

    Returns:
        φ = θ a along the axis a, shape (..., 3), in [rad], ‖φ‖ ≤ π.

    Source: Shepperd, Quaternion from rotation matrix, 1978.
    """
    w, x = _quaternion(np.asarray(R))
    length = sqrt((x * x).sum(axis=-1))
    # θ/‖x‖ → 2 where there is no turn; np.where keeps this free of branches
    small = length < 1e-150
    ratio = np.where(small, 2, 2 * np.arctan2(length, np.abs(w)) / np.where(small, 1, length))
    return (np.where(w < 0, -1, 1) * ratio)[..., None] * x


def orientation_error(R_desired: Array, R: Array) -> Array:
    """The turn in base axes that takes R to the desired orientation: φ with R_desired = exp(φ̂) R, shape (..., 3)."""
    return rotation_vector(R_desired @ transpose(R))


def _quaternion(R: Array) -> tuple[Array, Array]:
    """The unit quaternion (w, x), shapes (...) and (..., 3), of a rotation; its sign is free.

    The largest of its four parts is found first, a branch on values: dividing by it is what keeps all digits.
    """
    xx, yy, zz = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    wx, wy, wz = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    xy, xz, yz = R[..., 0, 1] + R[..., 1, 0], R[..., 0, 2] + R[..., 2, 0], R[..., 1, 2] + R[..., 2, 1]
    outer = np.stack(  # 4 (w, x)(w, x)ᵀ, row by row
        [
            np.stack([1 + xx + yy + zz, wx, wy, wz], axis=-1),
            np.stack([wx, 1 + xx - yy - zz, xy, xz], axis=-1),
            np.stack([wy, xy, 1 - xx + yy - zz, yz], axis=-1),
            np.stack([wz, xz, yz, 1 - xx - yy + zz], axis=-1),
        ],
        axis=-2,
    )
    largest = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    row = np.take_along_axis(outer, largest[..., None, None], axis=-2)[..., 0, :]
    unit = row / sqrt((row * row).sum(axis=-1, keepdims=True))
    return unit[..., 0], unit[..., 1:]
