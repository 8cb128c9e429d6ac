"""Closed parts of a mesh: connected surfaces, oriented outward, and cavities, oriented inward.

A part inside another one is a cavity if it faces inward; if it faces outward, both fill the same space. Winding numbers
at points just inside the surfaces determine which part contains another one, and which parts intersect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy import ndarray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components

from robot_dyn.shapes.winding import just_inside, winding

_SAME = 1e-7  # relative to the size of a mesh: closer corners are merged
_FLAT = 1e-9  # relative to the cube of its length: smaller volumes count as 0
_MAX, _MIN, _WORK = 192, 48, 4_000_000  # largest and smallest number of points on a part; limit of points × triangles


@final
@dataclass(frozen=True, eq=False)
class ClosedParts:
    """The closed parts of a mesh.

    Attributes:
        corners: Triangle corners of each part, (m, 3, 3), in [m], counter-clockwise seen from outside the material.
        flipped_parts: Indices of parts with faces that were inside out and were flipped.
        overlaps: Pairs of parts that share some volume.
    """

    corners: tuple[ndarray, ...]
    flipped_parts: tuple[int, ...]
    overlaps: tuple[tuple[int, int], ...]

    def place(self, part: int) -> str:
        """Return the number and centre of a part, for messages."""
        points = self.corners[part].reshape(-1, 3)
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        return f"part {part + 1} at ({', '.join(f'{x:.3g}' for x in middle)}) m"


def closed_parts(corners: ndarray) -> ClosedParts | None:
    """Return the closed parts of a mesh; None if a part has an open edge.

    Args:
        corners: Corners of the triangles, (m, 3, 3), in [m].
    """
    from trimesh.grouping import unique_rows

    middle = (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1))) / 2
    size = float(np.abs(corners - middle).max())
    if not 0 < size < np.inf:
        return None
    _, vertex = unique_rows(np.rint((corners - middle).reshape(-1, 3) / (_SAME * size)).astype(np.int64))
    faces = vertex.reshape(-1, 3)
    proper = (faces != np.roll(faces, 1, axis=1)).all(axis=1)  # a triangle with two equal corners has no area
    faces, corners = faces[proper], corners[proper]
    if not len(faces):
        return None
    parts, turned, any_turned = _oriented(faces)
    if parts is None:
        return None
    corners = np.where(turned[:, None, None], corners[:, ::-1], corners)
    solid_parts, was_turned = [], []
    for part in range(parts.max() + 1):
        within = corners[parts == part]
        if abs(_volume(within)) > _FLAT * float(np.ptp(within.reshape(-1, 3), axis=0).max()) ** 3:
            solid_parts.append(within)
            was_turned.append(bool(any_turned[part]))
    return _nested(solid_parts, was_turned)


def _oriented(faces: ndarray) -> tuple[ndarray | None, ndarray, ndarray]:
    """Return the part of each face, the faces to flip so that each part is consistent, and the parts with such faces.

    Return None for the parts if they are not closed.
    """
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)  # ends of the three edges of each face
    _, edge = np.unique(ends.min(axis=1) * (ends.max() + 1) + ends.max(axis=1), return_inverse=True)
    face, sign = np.repeat(np.arange(len(faces)), 3), np.where(ends[:, 0] < ends[:, 1], 1, -1)
    count, n = np.bincount(edge), len(faces)
    graph = coo_matrix((np.ones(len(edge)), (face, n + edge)), shape=(n + len(count), n + len(count)))
    parts = connected_components(graph, directed=False)[1][:n]
    parts = np.unique(parts, return_inverse=True)[1].reshape(-1)
    turned, any_turned = np.zeros(n, dtype=bool), np.zeros(parts.max() + 1, dtype=bool)
    unbalanced = np.bincount(edge, sign) != 0
    if not unbalanced.any():
        return parts, turned, any_turned
    any_turned[parts[face[unbalanced[edge]]]] = True
    touched = any_turned[parts[face]]
    if not (count[edge[touched]] == 2).all():
        return None, turned, any_turned
    order = np.argsort(edge[touched], kind="stable")
    pairs, signs = face[touched][order].reshape(-1, 2), sign[touched][order].reshape(-1, 2)
    agree = signs[:, 0] != signs[:, 1]  # two consistent faces traverse their edge in opposite directions
    _turn(turned, np.flatnonzero(any_turned), parts, pairs, agree)
    if (turned[pairs[:, 0]] ^ turned[pairs[:, 1]] == agree).any():
        return None, turned, any_turned  # not orientable, for example a Klein bottle
    return parts, turned, any_turned


def _turn(turned: ndarray, mixed: ndarray, parts: ndarray, pairs: ndarray, agree: ndarray) -> None:
    """Flip faces of inconsistent parts so that all agree with the first face, along a tree of neighbours."""
    n = len(parts)
    graph = coo_matrix((np.where(agree, 1.0, 2.0), (pairs[:, 0], pairs[:, 1])), shape=(n, n)).tocsr()
    graph = graph.maximum(graph.T).tocsr()
    for part in mixed:
        first = int(np.flatnonzero(parts == part)[0])
        order, before = breadth_first_order(graph, first, directed=False)
        steps = np.asarray(graph[before[order[1:]], order[1:]]).reshape(-1) == 2.0
        for face, step in zip(order[1:], steps, strict=True):
            turned[face] = turned[before[face]] ^ step


def _volume(corners: ndarray) -> float:
    a, b, c = np.moveaxis(corners - corners.mean(axis=(0, 1)), 1, 0)
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def _nested(parts: Sequence[ndarray], was_turned: Sequence[bool]) -> ClosedParts:
    """Orient parts outward and cavities inward, and find parts that overlap."""
    outward = [part if _volume(part) > 0 else part[:, ::-1] for part in parts]
    faces_in = [_volume(part) < 0 for part in parts]
    around: list[set[int]] = [set() for _ in parts]  # the parts that contain a part
    overlaps = []
    for i, j in _with_common_boxes(parts):
        in_j, in_i = _fraction_inside(outward[i], outward[j]), _fraction_inside(outward[j], outward[i])
        if in_j == 1 and in_i < 1:
            around[i].add(j)
        elif in_i == 1 and in_j < 1:
            around[j].add(i)
        elif in_i > 0 or in_j > 0:
            overlaps.append((i, j))
    turned = [*was_turned]
    for part in sorted(range(len(parts)), key=lambda part: len(around[part])):
        if faces_in[part] and len(around[part]) % 2 == 0:  # not a cavity: the part and all it contains are inside out
            for inner in (part, *(k for k in range(len(parts)) if part in around[k])):
                faces_in[inner], turned[inner] = not faces_in[inner], not turned[inner] or was_turned[inner]
        elif not faces_in[part] and len(around[part]) % 2 == 1:
            overlaps.append((min(around[part], key=lambda k: -len(around[k])), part))
    corners = tuple(part[:, ::-1] if inward else part for part, inward in zip(outward, faces_in, strict=True))
    return ClosedParts(corners, tuple(np.flatnonzero(turned).tolist()), tuple(sorted(overlaps)))


def _with_common_boxes(parts: Sequence[ndarray]) -> list[tuple[int, int]]:
    """Return the pairs of parts whose axis-aligned bounding boxes overlap."""
    low, high = (np.array([f(part, axis=(0, 1)) for part in parts]).reshape(-1, 3) for f in (np.min, np.max))
    return [(i, i + 1 + j) for i in range(len(parts)) for j in _common(low[i], high[i], low[i + 1 :], high[i + 1 :])]


def _common(low: ndarray, high: ndarray, lows: ndarray, highs: ndarray) -> list[int]:
    return np.flatnonzero(((low < highs) & (lows < high)).all(axis=1)).tolist()


def _fraction_inside(part: ndarray, other: ndarray) -> float:
    """Return the fraction of points just inside a part that lie inside another one."""
    points = just_inside(part, int(np.clip(_WORK // max(len(part), len(other)), _MIN, _MAX)))
    low, high = other.min(axis=(0, 1)), other.max(axis=(0, 1))
    near = ((points > low) & (points < high)).all(axis=1)
    if not near.any():
        return 0.0
    return float((winding(points[near], other) > 0.5).sum() / len(points))
