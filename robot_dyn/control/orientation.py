"""Orientation error: the rotation vector φ of R = exp(φ̂), φ = θ a with 0 ≤ θ ≤ π.

[Murray, Li, Sastry 1994, sec. 2.2; Siciliano et al. 2009, sec. 3.7.3]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array, sqrt, transpose
from robot_dyn.foundations.errors import QueryError, shown
from robot_dyn.foundations.validate import real


def rotation_vector(R: Array) -> Array:
    """Logarithm of a rotation, φ with exp(φ̂) = R: accurate from no turn to half a turn.

    By the unit quaternion (w, x): θ = 2 atan2(‖x‖, |w|), which loses no digits where the textbook's
    (R − Rᵀ)θ/(2 sin θ) is 0/0. At exactly half a turn φ and −φ are the same rotation; one of them is returned.

    Args:
        R: Shape (..., 3, 3).

    Returns:
        φ = θ a along the axis a, shape (..., 3), in [rad], ‖φ‖ ≤ π.

    Raises:
        QueryError: If R has another shape, or an entry that is nan or larger than 2, which no rotation has.

    Source: Shepperd, Quaternion from rotation matrix, 1978.
    """
    w, x = _quaternion(_matrices("R", R))
    length = sqrt((x * x).sum(axis=-1, keepdims=True))
    # θ/‖x‖ → 2 where there is no turn; np.where keeps this free of branches
    small = length < 1e-150
    ratio = np.where(small, 2, 2 * np.arctan2(length, np.abs(w)) / np.where(small, 1, length))
    return np.where(w < 0, -1, 1) * ratio * x


def orientation_error(R_desired: Array, R: Array) -> Array:
    """The turn in base axes that takes R to the desired orientation: φ with R_desired = exp(φ̂) R, shape (..., 3)."""
    return rotation_vector(_matrices("R_desired", R_desired) @ transpose(_matrices("R", R)))


def _matrices(name: str, R: Array) -> Array:
    """Matrices of numbers, or of symbols; QueryError if they are not 3 by 3, or no rotation has such an entry."""
    symbols = isinstance(R, np.ndarray) and R.dtype.kind == "O"
    try:
        array = R if symbols else real(R)
    except ValueError as found:
        raise QueryError(f"{name} must be rotations of shape (..., 3, 3), got {found}") from None
    if array.shape[-2:] != (3, 3):
        raise QueryError(f"{name} must be rotations of shape (..., 3, 3), got {shown(R)}")
    if not symbols and not (np.abs(array) <= 2).all():  # nan, or squares that might overflow
        raise QueryError(f"{name} must be rotations, whose entries lie in [-1, 1], got {shown(R)}")
    return array


def _quaternion(R: Array) -> tuple[Array, Array]:
    """The unit quaternion (w, x), shapes (..., 1) and (..., 3), of a rotation; its sign is free.

    It is the row of the largest of its four parts: dividing by that one is what keeps all digits.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = ([R[..., i, j : j + 1] for j in range(3)] for i in range(3))
    rows = (  # of 4 (w, x)(w, x)ᵀ
        (1 + xx + yy + zz, zy - yz, xz - zx, yx - xy),
        (zy - yz, 1 + xx - yy - zz, xy + yx, xz + zx),
        (xz - zx, xy + yx, 1 - xx + yy - zz, yz + zy),
        (yx - xy, xz + zx, yz + zy, 1 - xx - yy + zz),
    )
    outer = np.stack([np.concatenate(each, axis=-1) for each in rows], axis=-2)
    row, largest = outer[..., 0, :], outer[..., 0, :1]
    for k in (1, 2, 3):
        other = outer[..., k, k : k + 1]
        row, largest = np.where(other > largest, outer[..., k, :], row), np.maximum(other, largest)
    unit = row / sqrt((row * row).sum(axis=-1, keepdims=True))
    return unit[..., :1], unit[..., 1:]
