"""Triangles as a body of density 1: the solid they enclose, its convex hull, or the shell they form.

    solid, hull   m = ∫ dx,  c = (1/m) ∫ x dx,  I = ∫ r̂ᵀ r̂ dx,   r = x − c     at 1 kg/m³, m is the volume
    shell         same, over the surface                                         at 1 kg/m², m is the area

Over a triangle with corners v₁, v₂, v₃ and area A, ∫ x dA = A s/3 and ∫ x xᵀ dA = A (Σ vᵢ vᵢᵀ + s sᵀ)/12, s = Σ vᵢ.
trimesh integrates the solids. The origin is moved to the middle of the triangles, so that bodies far from the frame do
not lose digits. [Tonon, Explicit exact formulas for the 3-D tetrahedron inertia tensor, 2005; the triangle is its plane
case]
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy import ndarray

from robot_dyn.description.inertia import MassProperties
from robot_dyn.foundations.errors import QueryError
from robot_dyn.shapes.closed_parts import closed_parts
from robot_dyn.shapes.mesh_files import MeshError

_FLAT = 1e-9  # smallest volume of a body, relative to the cube of its length; a smaller one counts as flat
_ROUNDED = 1.001  # relative to the hull's volume, which a solid exceeds only by float32 rounding
_NAMED = 3  # maximum number of overlaps in a message
REMEDY = "export their union, or count the shared volume twice: allow_overlap=True, --allow-overlap"


@final
@dataclass(frozen=True, eq=False)
class Solid:
    """The solid that closed surfaces enclose.

    Attributes:
        body: Mass properties at 1 kg/m³.
        parts: Number of closed parts.
        flipped_parts: Number of parts with faces that were inside out and were flipped.
    """

    body: MassProperties
    parts: int
    flipped_parts: int


def solid(vertices: ndarray, faces: ndarray, *, allow_overlap: bool = False) -> Solid | None:
    """Return the solid that triangles enclose; None if they are not closed or enclose no volume.

    Parts that are inside out are flipped. A part inside another one is a cavity if it faces inward.

    Args:
        vertices: (k, 3), in [m].
        faces: (m, 3), indices of vertices, counter-clockwise seen from outside.
        allow_overlap: Count the volume shared by several parts once for each of them.

    Raises:
        MeshError: If parts overlap and `allow_overlap` is False, because their mass is ambiguous.
    """
    if not len(faces) or (closed := closed_parts(np.asarray(vertices, dtype=float)[faces])) is None:
        return None
    if closed.overlaps and not allow_overlap:
        listed = "; ".join(f"{closed.place(i)} and {closed.place(j)}" for i, j in closed.overlaps[:_NAMED])
        more = f", and {len(closed.overlaps) - _NAMED} more pairs" if len(closed.overlaps) > _NAMED else ""
        raise MeshError(f"some of its {len(closed.corners)} closed parts overlap ({listed}{more}); {REMEDY}")
    body = _enclosed(closed.corners)
    if body is None:
        return None
    if not allow_overlap and (outer := hull(vertices)) is not None and body.mass > _ROUNDED * outer.mass:
        raise MeshError(f"its surface overlaps itself: it encloses more than its convex hull; {REMEDY}")
    return Solid(body, len(closed.corners), len(closed.flipped_parts))


@np.errstate(all="ignore")
def hull(points: ndarray) -> MassProperties | None:
    """Return the convex hull of points, (k, 3) in [m], at 1 kg/m³; None if they lie in a plane."""
    from scipy.spatial import QhullError
    from trimesh.convex import convex_hull

    points = np.asarray(points, dtype=float)
    if not len(points):
        return None
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    try:
        outer: Any = convex_hull(points - middle)
    except (QhullError, ValueError):
        return None
    body = _enclosed([np.asarray(outer.vertices)[outer.faces]])
    return None if body is None else body.moved(np.eye(3), middle)


def shell(vertices: ndarray, faces: ndarray) -> MassProperties | None:
    """Return the triangles themselves as a body, at 1 kg/m²; None if they have no area.

    Args:
        vertices: (k, 3), in [m].
        faces: (m, 3), indices of vertices.
    """
    v = np.asarray(vertices, dtype=float)[faces]
    area = np.linalg.norm(np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]), axis=1) / 2
    total = area.sum()
    if not total > 0:
        return None
    middle = v.mean(axis=(0, 1))
    com = middle + area @ (v - middle).mean(axis=1) / total
    r = v - com
    s = r.sum(axis=1)
    second = (np.einsum("f,fki,fkj->ij", area, r, r) + np.einsum("f,fi,fj->ij", area, s, s)) / 12
    return MassProperties(total, com, np.trace(second) * np.eye(3) - second)


@np.errstate(all="ignore")
def _enclosed(parts: Iterable[ndarray]) -> MassProperties | None:
    """Return the mass properties of the space inside parts, without cavities; None if they enclose no volume.

    Args:
        parts: Corners of the triangles of each closed part, (m, 3, 3), in [m].
    """
    from trimesh.triangles import mass_properties

    parts = [part for part in parts if len(part)]
    if not parts:
        return None
    low, high = (f([f(part, axis=(0, 1)) for part in parts], axis=0) for f in (np.min, np.max))
    middle = (low + high) / 2
    body: Any = mass_properties(np.concatenate([part - middle for part in parts]))
    if not body.volume > _FLAT * float((high - low).max()) ** 3:
        return None
    try:
        return MassProperties(body.mass, body.center_mass + middle, body.inertia)
    except QueryError:  # self-intersecting faces can enclose a non-physical inertia
        return None
