"""The stage: a robot as a tree of nodes, one a joint, each moved by its own track: g_parent,i(q) = gᵢ exp(ξ̂ᵢ qᵢ).

A node turns or slides in its parent, as in the product of exponentials, so that what the viewer draws between two
keyframes is the arm at the q between them. [Murray, Li, Sastry 1994, ch. 3 §2]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import final

import numpy as np

from robot_dyn.foundations.errors import QueryError, nearest
from robot_dyn.foundations.spatial import homogeneous
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.linkage import BASE, Body, Linkage, Pose
from robot_dyn.model.robot import Robot
from robot_dyn.view import commands
from robot_dyn.view.commands import Command
from robot_dyn.view.geometry.visuals import Piece
from robot_dyn.view.keyframes import Keyframes


@final
@dataclass(frozen=True)
class Stage:
    """Where the parts of a robot stand in the viewer's tree.

    Attributes:
        root: Path of the robot.
        robot: What is shown.
    """

    root: str
    robot: Robot

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
        """Path of a link's node; QueryError if there is no such link."""
        if link not in self.linkage.links:
            raise QueryError(f"no link {link!r}; {nearest(link, self.linkage.links)}")
        body, _, _ = self.linkage.links[link]
        return f"{self.root if body == BASE else self.paths[body]}/link {plain(link)}"

    def draw(self, pieces: tuple[Piece, ...], opacity: float = 1.0) -> list[Command]:
        """The commands that put links and their pieces in place."""
        found = [
            commands.set_transform(self.link_path(link), homogeneous(pose.R, pose.p))
            for link, (_, pose, _) in self.linkage.links.items()
        ]
        return found + self.fasten(pieces, opacity)

    def fasten(
        self, pieces: tuple[Piece, ...], opacity: float = 1.0, kind: str = "", seen: bool = True
    ) -> list[Command]:
        """The commands that fasten pieces to links; their names begin with their kind."""
        found, meshes = [], {id(piece.mesh): commands.triangles(piece.mesh) for piece in pieces}
        for number, piece in enumerate(pieces):
            path = f"{self.link_path(piece.link)}/{kind}{number}"
            rgba = (*piece.rgba[:3], piece.rgba[3] * opacity)
            look = commands.material(rgba, vertex_colors=piece.mesh.colors is not None)
            if piece.image is not None:
                look["image"] = piece.image
            found.append(commands.set_object(path, meshes[id(piece.mesh)], look))
            found.append(commands.set_transform(path, piece.pose))
            if not seen:
                found.append(commands.set_property(path, "visible", False))
        return found

    def tracks(self, keys: Keyframes) -> dict[str, list[Command]]:
        """The track of each joint, by path; and its place at the first keyframe."""
        return {
            path: _tracks(body, keys.t, keys.q[:, index])
            for index, (path, body) in enumerate(zip(self.paths, self.linkage.bodies, strict=True))
        }

    def corners(self, pieces: tuple[Piece, ...], q: np.ndarray) -> np.ndarray:
        """Corners of the boxes about all pieces at positions q (k, n), and the base and the tip, (m, 3)."""
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
        """The link at the end of the longest chain of joints, and of those the farthest from its joint."""

        def reach(link: str) -> tuple[int, float]:
            body, pose, _ = self.linkage.links[link]
            return (len(self.linkage.bodies[body].path) if body != BASE else 0), float(np.linalg.norm(pose.p))

        return max(self.linkage.links, key=reach)


def _tracks(body: Body, t: np.ndarray, q: np.ndarray) -> list[Command]:
    """Placement g exp(ξ̂ q) of a joint's node at keyframes."""
    from scipy.spatial.transform import Rotation

    zero = Rotation.from_matrix(body.pose.R)
    if body.revolute:
        turns = (zero * Rotation.from_rotvec(q[:, None] * body.axis)).as_quat()
        fixed = commands.track("position", "vector", t[:1], body.pose.p)
        return [fixed, commands.track("quaternion", "quaternion", t, turns)]
    slides = body.pose.p + q[:, None] * (body.pose.R @ body.axis)
    fixed = commands.track("quaternion", "quaternion", t[:1], zero.as_quat())
    return [fixed, commands.track("position", "vector", t, slides)]


def placement(at: Mapping[int, tuple[np.ndarray, np.ndarray]], body: int, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """(R, p) in the base of a pose in a body, from those of all bodies."""
    if body == BASE:
        return pose.R, pose.p
    R, p = at[body]
    return R @ pose.R, R @ pose.p + p


def plain(name: str) -> str:
    """A name as one part of a path, which the viewer cuts at slashes."""
    return name.replace("/", "∕")
