"""Meshes of a box, cylinder, ellipsoid and arrow; curved ones are profiles (r, z) revolved about the z axis."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import Any

import numpy as np
from numpy import ndarray

from robot_dyn.shapes.triangles import Mesh, welded

_SEGMENTS = 48  # segments of a circle


def box(x: float, y: float, z: float) -> Mesh:
    """Return a box with edges x, y, z in [m] about the origin."""
    corners, uv = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            quad = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])[:: int(sign)]
            face = np.insert(quad, 0, sign, axis=1)
            corners += [np.roll(face, axis, axis=1)[[0, 1, 2]], np.roll(face, axis, axis=1)[[0, 2, 3]]]
            uv += [(quad[[0, 1, 2]] + 1) / 2, (quad[[0, 2, 3]] + 1) / 2]
    return _mesh(np.array(corners) * (x / 2, y / 2, z / 2), None, np.array(uv))


def cylinder(radius: float, length: float) -> Mesh:
    """Return a cylinder about the z axis with its middle at the origin, in [m]."""
    h = length / 2
    return _revolved([(0, -h), (radius, -h), (radius, h), (0, h)])


def ellipsoid(a: float, b: float, c: float) -> Mesh:
    """Return an ellipsoid with semi-axes a, b, c along x, y, z in [m]."""
    turn = np.linspace(-pi / 2, pi / 2, _SEGMENTS // 2 + 1)
    return _revolved(np.column_stack([np.cos(turn), np.sin(turn)]), (a, b, c))


def arrow(length: float) -> Mesh:
    """Return an arrow from the origin along the z axis, its length in [m]."""
    shaft, head = 0.015 * length, 0.05 * length
    return _revolved([(0, 0), (shaft, 0), (shaft, 0.8 * length), (head, 0.8 * length), (0, length)])


def _revolved(profile: Any, stretch: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Mesh:
    """Return the surface of an upward profile (r, z) revolved about z; it is smooth up to `CREASE`."""
    r, z = np.asarray(profile, dtype=float).T
    r = np.where(r < 1e-12 * np.abs(r).max(), 0.0, r)
    turn = 2 * pi * np.arange(_SEGMENTS + 1) / _SEGMENTS
    cos, sin = np.cos(turn), np.sin(turn)
    cos[-1], sin[-1] = cos[0], sin[0]  # so that the seam closes to the last bit
    points = np.stack([np.outer(r, cos), np.outer(r, sin), np.repeat(z[:, None], len(turn), axis=1)], axis=2) * stretch
    along = np.insert(np.cumsum(np.hypot(np.diff(r), np.diff(z))), 0, 0.0)
    uv = np.stack(np.meshgrid(turn / turn[-1], along / along[-1]), axis=2)

    def triangles(grid: ndarray) -> ndarray:
        a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
        both = np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)], axis=2)
        return both.reshape(-1, 3, grid.shape[2])

    return _mesh(triangles(points), None, triangles(uv))


def _mesh(*columns: Any) -> Mesh:
    mesh = welded(*columns)
    assert mesh is not None, "a primitive with positive lengths has area"
    return mesh


def sphere(radius: float) -> Mesh:
    """Return a sphere about the origin, its radius in [m]."""
    return ellipsoid(radius, radius, radius)


PRIMITIVES: dict[str, Callable[..., Mesh]] = {"box": box, "cylinder": cylinder, "sphere": sphere}  # shapes in URDF
