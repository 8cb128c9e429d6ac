"""Triangles with equal corners merged and creased normals: smooth where faces meet at under 35°, otherwise flat."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy import ndarray

CREASE = np.cos(np.deg2rad(35.0))  # faces that meet at a larger angle have a visible edge
_CROWD = 256  # vertices with more faces are drawn flat: comparing pairs is quadratic


@final
@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in the frame of their part, counter-clockwise seen from outside.

    Attributes:
        vertices: (k, 3) float32, in [m].
        normals: (k, 3) float32, unit vectors.
        faces: (m, 3) uint32, indices of vertices.
        uv: Texture coordinates (k, 2) float32, origin at the lower left; or None.
        colors: (k, 3) uint8 where the file colours its vertices; or None.
    """

    vertices: ndarray
    normals: ndarray
    faces: ndarray
    uv: ndarray | None = None
    colors: ndarray | None = None

    def __post_init__(self) -> None:
        types = {"vertices": "f4", "normals": "f4", "faces": "u4", "uv": "f4", "colors": "u1"}
        for name, kind in types.items():
            if (array := getattr(self, name)) is not None:
                array = np.array(array, dtype=kind)
                array.setflags(write=False)
                object.__setattr__(self, name, array)


def welded(
    corners: ndarray, normals: ndarray | None = None, uv: ndarray | None = None, colors: ndarray | None = None
) -> Mesh | None:
    """Return triangles with equal corners merged; None if none has a finite area.

    Missing or implausible normals are computed, smooth up to `CREASE`.

    Args:
        corners: (m, 3, 3), in [m].
        normals: (m, 3, 3) or None.
        uv: (m, 3, 2) or None.
        colors: (m, 3, 3) in 0 … 255 or None.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        corners = np.asarray(corners).astype("f4") + np.float32(0)  # −0 becomes 0: equal corners have equal bits
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).astype(float)
        good = np.isfinite(corners).all(axis=(1, 2)) & np.isfinite(area).all(axis=1) & area.any(axis=1)
    if not good.any():
        return None
    columns: Any = (corners, area, normals, uv, colors)
    if not good.all():
        columns = [None if array is None else np.asarray(array)[good] for array in columns]
    corners, area, normals, uv, colors = columns
    face_normals = np.divide(area, np.linalg.norm(area, axis=1, keepdims=True), out=area)
    stated = _plausible(normals, face_normals)
    smooth: Any = (_creased(corners, face_normals) if stated is None else stated).astype("f4")
    parts = [corners, np.rint(127 * smooth) + np.float32(0)]
    parts += [] if uv is None else [np.asarray(uv).astype("f4") + np.float32(0)]
    parts += [] if colors is None else [np.asarray(colors).astype("f4")]
    first, faces = _distinct(np.concatenate(parts, axis=2).reshape(3 * len(corners), -1))
    columns = (None if array is None else array.reshape(-1, array.shape[2])[first] for array in (uv, colors))
    return Mesh(corners.reshape(-1, 3)[first], smooth.reshape(-1, 3)[first], faces.reshape(-1, 3), *columns)


def _distinct(rows: ndarray) -> tuple[ndarray, ndarray]:
    """Return the index of the first of each distinct row of float32, in order, and the kind of each row."""
    from trimesh.grouping import unique_ordered

    bits = np.ascontiguousarray(rows).view(f"V{4 * rows.shape[1]}").ravel()
    _, first, kind = unique_ordered(bits, return_index=True, return_inverse=True)
    return first, kind


def _plausible(normals: ndarray | None, face_normals: ndarray) -> ndarray | None:
    """Return unit normals, or None if they are not finite, point inward, or merely repeat the flat triangles.

    Many exporters write flat normals for round surfaces: computed normals halve the file and look right.
    """
    if normals is None:
        return None
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    if not np.isfinite(length).all() or not length.all():
        return None
    unit = np.asarray(normals) / length
    cos = np.einsum("fci,fi->fc", unit, face_normals)
    return unit if (cos > 0).mean() > 0.9 and (cos > 0.9999).mean() < 0.95 else None


def _creased(corners: ndarray, face_normals: ndarray) -> ndarray:
    """Return corner normals (m, 3, 3), averaged over faces within `CREASE` of the corner's own, weighted by angle.

    Source: Thürmer and Wüthrich, Computing vertex normals from polygonal facets, 1998.
    """
    from trimesh.triangles import angles

    blocks = np.array_split(corners, 1 + len(corners) // 2**16)
    angle = np.concatenate([angles(block).astype("f4") for block in blocks]).reshape(-1)
    _, vertex = _distinct(corners.reshape(-1, 3))
    order = np.argsort(vertex, kind="stable")
    degree = np.bincount(vertex)
    start = np.cumsum(degree) - degree
    out = np.repeat(face_normals.astype("f4"), 3, axis=0)
    for d in np.unique(degree):
        if 1 < d <= _CROWD:
            at_vertices = order[start[degree == d, None] + np.arange(d)]
            for block in np.array_split(at_vertices, 1 + len(at_vertices) * d * d // 2**20):
                n = face_normals[block // 3]
                near = (np.einsum("vai,vbi->vab", n, n) > CREASE) * angle[block][:, None]
                out[block] = np.einsum("vab,vbi->vai", near, n) + 1e-9 * n
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    return out.reshape(-1, 3, 3)
