"""The stage: a robot as a tree of nodes, one per joint, each moved by its own track: g_parent,i(q) = gᵢ exp(ξ̂ᵢ qᵢ).

A node rotates or slides in its parent, as in the product of exponentials, so that between two keyframes the viewer
draws the arm at an intermediate q. [Murray, Li, Sastry 1994, ch. 3 §2]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import final

import numpy as np

from robot_dyn.foundations.errors import QueryError, nearest
from robot_dyn.foundations.spatial import first_moment, homogeneous
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.linkage import BASE, Body, Linkage, Pose
from robot_dyn.model.robot import Robot
from robot_dyn.view.commands import Canvas, Rgba, triangles
from robot_dyn.view.geometry.visuals import Drawing, Piece
from robot_dyn.view.keyframes import Keyframes

Placements = Mapping[int, tuple[np.ndarray, np.ndarray]]  # (R, p) in the base, by body
_CHUNK = 20_000  # samples whose placements are in memory at a time


@final
@dataclass(frozen=True)
class Stage:
    """The nodes of a robot in the viewer's tree.

    Attributes:
        root: Path of the robot.
        robot: The robot.
        opacity: Opacity of everything drawn at the node.
    """

    root: str
    robot: Robot
    opacity: float = 1.0

    def tint(self, rgba: Rgba) -> Rgba:
        """Return a colour with the opacity of this stage."""
        return (*rgba[:3], rgba[3] * self.opacity)

    @cached_property
    def linkage(self) -> Linkage:
        """Kinematics of the own implementation; it shares no code with Pinocchio."""
        return Lagrangian(self.robot).linkage

    @cached_property
    def paths(self) -> tuple[str, ...]:
        """Path of each moving body's node."""
        paths: list[str] = []
        for index, body in enumerate(self.linkage.bodies):
            parent = self.root if body.parent == BASE else paths[body.parent]
            paths.append(f"{parent}/{index} {plain(body.joint)}")
        return tuple(paths)

    def link_path(self, link: str) -> str:
        """Return the path of a link's node; raise a QueryError for an unknown link."""
        if link not in self.linkage.links:
            raise QueryError(f"no link {link!r}; {nearest(link, self.linkage.links)}")
        body, _, _ = self.linkage.links[link]
        return f"{self.root if body == BASE else self.paths[body]}/link {plain(link)}"

    def draw(self, canvas: Canvas, look: Drawing, keys: Keyframes, shows_boxes: bool) -> None:
        """Draw the robot, moved by keyframes, with its inertia boxes, visible or not."""
        for link, (_, pose, _) in self.linkage.links.items():
            canvas.place(self.link_path(link), homogeneous(pose.R, pose.p))
        pieces = [("", number, piece) for number, piece in enumerate(look.pieces)]
        pieces += [("inertia ", number, piece) for number, piece in enumerate(look.boxes)]
        meshes = {id(piece.mesh): triangles(piece.mesh) for _, _, piece in pieces}
        for kind, number, piece in pieces:
            path = f"{self.link_path(piece.link)}/{kind}{number}"
            canvas.mesh(path, meshes[id(piece.mesh)], self.tint(piece.rgba), piece.image)
            canvas.place(path, piece.pose)
            if kind and not shows_boxes:
                canvas.hide(path)
        for index, (path, body) in enumerate(zip(self.paths, self.linkage.bodies, strict=True)):
            canvas.move(path, **_tracks(body, keys.t, keys.q[:, index]))

    def positions(self, q: np.ndarray, links: Sequence[str]) -> np.ndarray:
        """Return origins of links in the base at positions q (m, n), shape (m, k, 3)."""
        poses = [self.linkage.links[link][:2] for link in links]

        def origins(at: Placements, m: int) -> np.ndarray:
            return np.stack([np.broadcast_to(placement(at, *pose)[1], (m, 3)) for pose in poses], axis=1)

        return self._over(q, origins)

    def centre_of_mass(self, q: np.ndarray) -> np.ndarray:
        """Return the centre of mass of the moving bodies, in the base, (m, 3): Σ mᵢ pᵢ / Σ mᵢ."""

        def middle(at: Placements, m: int) -> np.ndarray:
            total, mass = np.zeros((m, 3)), 0.0
            for inertia, (R, p) in zip(self.linkage.inertias, at.values(), strict=True):
                total, mass = total + inertia[0, 0] * p + R @ first_moment(inertia), mass + inertia[0, 0]
            return total / mass if mass > 0 else total

        return self._over(q, middle)

    def _over(self, q: np.ndarray, function: Callable[[Placements, int], np.ndarray]) -> np.ndarray:
        chunks = np.array_split(q, 1 + len(q) // _CHUNK)
        return np.concatenate([function(self.linkage.at(chunk).in_base, len(chunk)) for chunk in chunks])

    def corners(self, pieces: tuple[Piece, ...], q: np.ndarray) -> np.ndarray:
        """Return corners of the boxes about all pieces at positions q (k, n), the base and the tip, (m, 3)."""
        at, points = self.linkage.at(q).in_base, [np.zeros((1, 3))]
        for piece in pieces:
            R, p = placement(at, *self.linkage.links[piece.link][:2])
            edges = zip(piece.mesh.vertices.min(axis=0), piece.mesh.vertices.max(axis=0), strict=True)
            local = np.array(list(product(*edges))) @ piece.pose[:3, :3].T + piece.pose[:3, 3]
            points.append((np.einsum("...ij,cj->...ci", R, local) + p[..., None, :]).reshape(-1, 3))
        points.append(placement(at, *self.linkage.links[self.tip][:2])[1].reshape(-1, 3))
        return np.concatenate(points)

    @cached_property
    def tip(self) -> str:
        """Link at the end of the longest chain of joints; among several, the one farthest from its joint."""

        def reach(link: str) -> tuple[int, float]:
            body, pose, _ = self.linkage.links[link]
            return (len(self.linkage.bodies[body].path) if body != BASE else 0), float(np.linalg.norm(pose.p))

        return max(self.linkage.links, key=reach)


def _tracks(body: Body, t: np.ndarray, q: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the placement g exp(ξ̂ q) of a joint's node at keyframes."""
    from scipy.spatial.transform import Rotation

    zero = Rotation.from_matrix(body.pose.R)
    if body.revolute:
        turns = (zero * Rotation.from_rotvec(q[:, None] * body.axis)).as_quat()
        return {"position": (t[:1], body.pose.p), "quaternion": (t, turns)}
    slides = body.pose.p + q[:, None] * (body.pose.R @ body.axis)
    return {"quaternion": (t[:1], zero.as_quat()), "position": (t, slides)}


def placement(at: Placements, body: int, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Return (R, p) in the base of a pose in a body, from the placements of all bodies."""
    if body == BASE:
        return pose.R, pose.p
    R, p = at[body]
    return R @ pose.R, R @ pose.p + p


def plain(name: str) -> str:
    """Return a name as one part of a path; the viewer splits paths at slashes."""
    return name.replace("/", "∕")
