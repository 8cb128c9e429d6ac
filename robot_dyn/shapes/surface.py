"""Triangles as a body of density 1: the solid they enclose, its convex hull, and the shell they are themselves.

    solid, hull   m = ∫ dx,  c = (1/m) ∫ x dx,  I = ∫ r̂ᵀ r̂ dx,   r = x − c     at 1 kg/m³, m is the volume
    shell         the same over the surface                                     at 1 kg/m², m is the area

Over a triangle with corners v₁, v₂, v₃ and area A, ∫ x dA = A s/3 and ∫ x xᵀ dA = A (Σ vᵢ vᵢᵀ + s sᵀ)/12, s = Σ vᵢ.
[Tonon, Explicit exact formulas for the 3-D tetrahedron inertia tensor, 2005, of which this is the plane case]
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robot_dyn.description.inertia import MassProperties
from robot_dyn.foundations.errors import QueryError

_FLAT = 1e-9  # of the cube of its length: the volume of a surface that encloses none


@np.errstate(all="ignore")  # of a surface without volume, which is None
def solid(vertices: np.ndarray, faces: np.ndarray) -> MassProperties | None:
    """The solid that triangles enclose, at 1 kg/m³; None if they do not close, or face inward.

    Args:
        vertices: (k, 3), in [m].
        faces: (m, 3), indices of vertices, counter-clockwise seen from outside.
    """
    surface = _trimesh(vertices, faces)
    return _properties(surface, vertices) if surface.is_watertight and surface.is_winding_consistent else None


@np.errstate(all="ignore")
def hull(points: np.ndarray) -> MassProperties | None:
    """The convex hull of points, (k, 3) in [m], at 1 kg/m³; None if they lie in a plane."""
    from scipy.spatial import QhullError
    from trimesh.convex import convex_hull

    try:
        return _properties(convex_hull(np.asarray(points, dtype=float)), points)
    except (QhullError, ValueError):
        return None


def shell(vertices: np.ndarray, faces: np.ndarray) -> MassProperties | None:
    """The triangles themselves, at 1 kg/m²; None if they have no area.

    Args:
        vertices: (k, 3), in [m].
        faces: (m, 3), indices of vertices.
    """
    v = np.asarray(vertices, dtype=float)[faces]
    area = np.linalg.norm(np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]), axis=1) / 2
    total = area.sum()
    if not total > 0:
        return None
    com = area @ v.mean(axis=1) / total
    r = v - com
    s = r.sum(axis=1)
    second = (np.einsum("f,fki,fkj->ij", area, r, r) + np.einsum("f,fi,fj->ij", area, s, s)) / 12
    return MassProperties(total, com, np.trace(second) * np.eye(3) - second)


def _trimesh(vertices: np.ndarray, faces: np.ndarray) -> Any:
    """Triangles with equal corners merged."""
    import trimesh

    return trimesh.Trimesh(np.asarray(vertices, dtype=float), np.asarray(faces, dtype=int))


def _properties(surface: Any, vertices: np.ndarray) -> MassProperties | None:
    """The mass properties that trimesh integrates; None without a volume, or of parts inside out that no body has."""
    if not surface.volume > _FLAT * np.ptp(vertices, axis=0).max() ** 3:
        return None
    try:
        return MassProperties(surface.volume, surface.center_mass, surface.moment_inertia)
    except QueryError:
        return None
