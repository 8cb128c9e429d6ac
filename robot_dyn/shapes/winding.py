"""Winding numbers of closed surfaces: 1 at points inside, 0 outside, −1 inside a surface that is inside out.

    w(p) = (1/4π) Σ Ω(p),   tan(Ω/2) = a·(b × c) / (abc + (a·b) c + (b·c) a + (c·a) b)

Ω is the solid angle of a triangle with corners p + a, p + b, p + c.
[van Oosterom and Strackee 1983; Jacobson, Kavan, Sorkine-Hornung 2013]
"""

from __future__ import annotations

import numpy as np
from numpy import ndarray

_BLOCK = 2**17  # points × triangles per block
_INSET = 1e-4  # relative to the size of a part: thinner layers are not detected


def winding(points: ndarray, corners: ndarray) -> ndarray:
    """Return the winding numbers of a surface at points, (k,); near integers for a closed surface.

    Args:
        points: (k, 3), in [m], not on the surface.
        corners: Corners of the triangles, (m, 3, 3), in [m], counter-clockwise seen from outside.
    """
    blocks = np.array_split(points, 1 + len(points) * len(corners) // _BLOCK)
    return np.concatenate([_of_block(block, corners) for block in blocks])


def _of_block(points: ndarray, corners: ndarray) -> ndarray:
    a, b, c = np.moveaxis(corners[None] - points[:, None, None], 2, 0)
    ra, rb, rc = (np.linalg.norm(r, axis=2) for r in (a, b, c))
    dot = np.einsum
    volume = dot("pfi,pfi->pf", a, np.cross(b, c))
    plane = ra * rb * rc + dot("pfi,pfi->pf", a, b) * rc + dot("pfi,pfi->pf", b, c) * ra
    plane += dot("pfi,pfi->pf", c, a) * rb
    return np.arctan2(volume, plane).sum(axis=1) / (2 * np.pi)


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
