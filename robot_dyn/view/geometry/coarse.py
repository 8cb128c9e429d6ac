"""Coarse meshes, for small pages: corners that share a cell of a grid become one.

Source: Rossignac and Borrel, Multi-resolution 3D approximations for rendering complex scenes, 1993 (vertex clustering).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from robot_dyn.foundations.validate import choice
from robot_dyn.model.robot import Robot
from robot_dyn.shapes.triangles import Mesh, welded
from robot_dyn.view.geometry.visuals import Drawing, drawing

CELLS = 32  # cells along the longest side of a mesh


def coarse(mesh: Mesh) -> Mesh:
    """Return the mesh with the corners in each cubic cell merged at their mean, without collapsed triangles.

    No corner moves by more than the diagonal of a cell, √3 / `CELLS` of the longest side.
    """
    points = mesh.vertices.astype(float)
    low = points.min(axis=0)
    cells = np.floor((points - low) * (CELLS / np.ptp(points, axis=0).max()))
    _, cell, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(cell, values) for values in points.T], axis=1) / count[:, None]
    columns = (None if values is None else values[mesh.faces] for values in (mesh.uv, mesh.colors))
    return welded(means[cell[mesh.faces]], None, *columns) or mesh  # without triangles of no area


def look_of(robot: Robot, package_dirs: Iterable[str | Path], inertia: bool, meshes: str) -> Drawing:
    """Return the drawing of a robot with the meshes of its files, or with coarse ones."""
    choice("meshes", meshes, ("full", "coarse"))
    look = drawing(robot, package_dirs, inertia=inertia)
    return look if meshes == "full" else _coarsened(look)


def _coarsened(look: Drawing) -> Drawing:
    """Return a drawing with coarse meshes; pieces that share a mesh still share it."""
    meshes = {id(piece.mesh): piece.mesh for piece in look.pieces}
    known = {key: coarse(mesh) for key, mesh in meshes.items()}
    before, after = (sum(len(values.faces) for values in some.values()) for some in (meshes, known))
    remark = (
        f"meshes are coarse: {after} of {before} triangles, corners moved by up to {np.sqrt(3) / CELLS:.1%} of a mesh"
    )
    pieces = tuple(replace(piece, mesh=known[id(piece.mesh)]) for piece in look.pieces)
    return replace(look, pieces=pieces, remarks=(*look.remarks, remark))
