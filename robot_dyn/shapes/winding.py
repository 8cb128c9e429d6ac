"""Winding numbers of closed surfaces: 1 at points inside, 0 outside, −1 inside a surface that is inside out.

    w(p) = Σ s over the triangles that a ray from p crosses,   s = 1 where it leaves the surface, −1 where it enters

The majority of three oblique rays counts, because a ray may pass through a gap between corners that a file rounds
differently.
[O'Rourke, Computational Geometry in C, 1998, §7.5]
"""

from __future__ import annotations

from functools import reduce

import numpy as np
from numpy import ndarray

_BLOCK = 2**17  # points × triangles per block
_INSET = 1e-4  # relative to the size of a part: thinner layers are not detected
_SLOPES = 0.3819660112501051, 0.2360679774997896  # of a ray to an axis: parallel to no edge of usual parts


def winding(points: ndarray, corners: ndarray) -> ndarray:
    """Return the winding numbers of a closed surface at points, (k,), integers.

    Args:
        points: (k, 3), in [m], not on the surface.
        corners: Corners of the triangles, (m, 3, 3), in [m], counter-clockwise seen from outside.
    """
    axes = np.roll([0, 1, 2], 1), np.roll([0, 1, 2], 2), np.arange(3)
    return np.median([_crossings(points[:, k], corners[:, :, k]) for k in axes], axis=0)


def _crossings(points: ndarray, corners: ndarray) -> ndarray:
    """Return the sums of signed crossings of the rays from points along (slopes, 1), (k,)."""
    (p, height), (c, heights) = _along_ray(points), _along_ray(corners)
    c, heights = np.moveaxis(c, 1, 0), heights.T
    low, high, top = reduce(np.minimum, c).T, reduce(np.maximum, c).T, reduce(np.maximum, heights)
    result = np.empty(len(points))
    for rows in np.array_split(np.arange(len(points)), 1 + len(points) * len(corners) // _BLOCK):
        x, y, z = p[rows, :1], p[rows, 1:], height[rows, None]
        near = (low[0] <= x) & (x <= high[0]) & (low[1] <= y) & (y <= high[1]) & (z <= top)
        point, face = np.nonzero(near)
        a, b, d = c[:, face] - p[rows[point]]
        area = np.stack([_cross(b, d), _cross(d, a), _cross(a, b)])  # exactly opposite in two faces of an edge
        sign = np.trunc(np.sign(area).mean(axis=0))  # 0 where the ray misses the face
        above = (area * (heights[:, face] - height[rows[point]])).sum(axis=0) * sign > 0
        result[rows] = np.bincount(point[above], sign[above], minlength=len(rows))
    return result


def _along_ray(points: ndarray) -> tuple[ndarray, ndarray]:
    """Return the coordinates across the ray, (..., 2), and along it, (...)."""
    return points[..., :2] - points[..., 2:] * _SLOPES, points[..., 2]


def _cross(a: ndarray, b: ndarray) -> ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def just_inside(corners: ndarray, count: int) -> ndarray:
    """Return points just inside a closed surface, spread evenly over it, (k, 3) with k ≤ count.

    Points are dropped where the body is thinner than their distance from the surface.

    Args:
        corners: Corners of the triangles, (m, 3, 3), in [m], counter-clockwise seen from outside.
        count: Number of candidate points.
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice = np.linalg.norm(normals, axis=1)
    share = np.cumsum(twice) / twice.sum()
    at = (np.arange(count) + 0.5) / count
    chosen = np.minimum(np.searchsorted(share, at), len(corners) - 1)
    u, v = (
        np.arange(1, count + 1) * x % 1 for x in (0.7548776662466927, 0.5698402909980532)
    )  # a low-discrepancy sequence in a square
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    p, q, r = np.moveaxis(corners[chosen], 1, 0)
    points = p + u[:, None] * (q - p) + v[:, None] * (r - p)
    size = np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0))
    points = points - _INSET * size * normals[chosen] / twice[chosen, None]
    return points[winding(points, corners) > 0.5]
