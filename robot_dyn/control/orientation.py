"""Orientation error: the rotation vector φ of R = exp(φ̂), φ = θ a with 0 ≤ θ ≤ π.

[Murray, Li, Sastry 1994, sec. 2.2; Siciliano et al. 2009, sec. 3.7.3]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array, sqrt, transpose
from robot_dyn.foundations.errors import QueryError, shown
from robot_dyn.foundations.validate import real


def rotation_vector(R: Array) -> Array:
    """Compute the logarithm of a rotation, φ with exp(φ̂) = R, accurately for all angles from 0 to π.

    The unit quaternion (w, x) gives θ = 2 atan2(‖x‖, |w|), which loses no digits where the textbook's
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
    # θ/‖x‖ → 2 for small angles; np.where avoids branches
    small = length < 1e-150
    ratio = np.where(small, 2, 2 * np.arctan2(length, np.abs(w)) / np.where(small, 1, length))
    return np.where(w < 0, -1, 1) * ratio * x


def orientation_error(R_desired: Array, R: Array) -> Array:
    """Compute the rotation vector from R to the desired orientation, in base axes: R_desired = exp(φ̂) R, (..., 3)."""
    return rotation_vector(_matrices("R_desired", R_desired) @ transpose(_matrices("R", R)))


def _matrices(name: str, R: Array) -> Array:
    """Return matrices of numbers or symbols; raise a QueryError if they are not 3 by 3 or have entries above 2."""
    symbols = isinstance(R, np.ndarray) and R.dtype.kind == "O"
    try:
        array = R if symbols else real(R)
    except ValueError as error:
        raise QueryError(f"{name} must be rotations of shape (..., 3, 3), got {error}") from None
    if array.shape[-2:] != (3, 3):
        raise QueryError(f"{name} must be rotations of shape (..., 3, 3), got {shown(R)}")
    if not symbols and not (np.abs(array) <= 2).all():  # nan, or squares that might overflow
        raise QueryError(f"{name} must be rotations, whose entries lie in [-1, 1], got {shown(R)}")
    return array


def _quaternion(R: Array) -> tuple[Array, Array]:
    """Compute the unit quaternion (w, x) of a rotation, (..., 1) and (..., 3), up to sign.

    The row of the largest of its four parts is normalised, which keeps all digits.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = ([R[..., i, j : j + 1] for j in range(3)] for i in range(3))
    rows = (  # rows of 4 (w, x)(w, x)ᵀ
        (1 + xx + yy + zz, zy - yz, xz - zx, yx - xy),
        (zy - yz, 1 + xx - yy - zz, xy + yx, xz + zx),
        (xz - zx, xy + yx, 1 - xx + yy - zz, yz + zy),
        (yx - xy, xz + zx, yz + zy, 1 - xx - yy + zz),
    )
    outer = np.stack([np.concatenate(entries, axis=-1) for entries in rows], axis=-2)
    row, largest = outer[..., 0, :], outer[..., 0, :1]
    for k in (1, 2, 3):
        other = outer[..., k, k : k + 1]
        row, largest = np.where(other > largest, outer[..., k, :], row), np.maximum(other, largest)
    unit = row / sqrt((row * row).sum(axis=-1, keepdims=True))
    return unit[..., :1], unit[..., 1:]
