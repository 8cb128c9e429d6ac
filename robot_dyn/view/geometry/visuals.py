"""The appearance of a robot: every <visual> of its URDF as pieces of triangles fastened to links.

A piece is placed at g_link · pose. A note reports a visual that cannot be drawn as described, and its replacement: the
collision shape of the link, otherwise the ellipsoid of its inertia.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, TypeVar, final

import numpy as np
from numpy import ndarray

from robot_dyn.description.markup import parse
from robot_dyn.foundations.spatial import homogeneous
from robot_dyn.model.findings import estimated_links
from robot_dyn.model.robot import Robot
from robot_dyn.shapes import elements, mesh_files, meshes
from robot_dyn.shapes.addresses import as_written, find_file, shown
from robot_dyn.shapes.mesh_files import MeshError
from robot_dyn.shapes.meshes import WHITE, Part, Rgba
from robot_dyn.shapes.triangles import Mesh
from robot_dyn.view.geometry.inertia_boxes import inertia_boxes, inertia_ellipsoid, off_centre
from robot_dyn.view.geometry.shapes import PRIMITIVES

GREY: Rgba = (0.7, 0.7, 0.7, 1.0)  # without material; rviz uses red
_STAND_IN: Rgba = (0.9, 0.6, 0.3, 1.0)  # fractions of a replacement
_INERTIA: Rgba = (0.2, 0.4, 1.0, 0.35)
_DOUBTFUL: Rgba = (1.0, 0.15, 0.1, 0.5)
_Y_UP_REMARKS = {  # remarks on files with an unusual up axis
    meshes.COLLADA: "its Collada meshes with <up_axis> Y_UP are turned to z up, as in Gazebo: raw, as in rviz, they"
    " stand away from the masses of their links",
    meshes.GLTF: "its glTF meshes are not turned to z up: in glTF y is up, but turned they stand away from the masses"
    " of their links; export them with y up",
}
T = TypeVar("T")


@final
@dataclass(frozen=True, eq=False)
class Piece:
    """One mesh with one material, fastened to a link.

    Attributes:
        link: Name of the link.
        pose: Placement in the link's frame, shape (4, 4), rotation and translation; scales are in the vertices.
        mesh: Triangles of the visual; pieces of the same file and scale share the object.
        rgba: Red, green, blue and opacity, 0 … 1; times the texture, a PNG, if there is one.
    """

    link: str
    pose: ndarray
    mesh: Mesh
    rgba: Rgba
    image: bytes | None = None


@final
@dataclass(frozen=True)
class Drawing:
    """The appearance of a robot.

    Attributes:
        pieces: Pieces of the drawing.
        notes: Visuals that could not be drawn as described.
        remarks: Other remarks for the reader.
        boxes: The uniform box with the mass and moments of each body that moves, payloads included.
    """

    pieces: tuple[Piece, ...]
    notes: tuple[str, ...]
    remarks: tuple[str, ...] = ()
    boxes: tuple[Piece, ...] = ()

    def seen(self, inertia: bool) -> tuple[Piece, ...]:
        """Return the pieces that the page shows when it opens."""
        return self.pieces + self.boxes if inertia else self.pieces


def drawing(robot: Robot, package_dirs: Iterable[str | Path] = (), *, inertia: bool = False) -> Drawing:
    """Return the pieces of every visual of a robot whose mesh files can be found.

    Args:
        robot: The robot; edits do not change its appearance.
        package_dirs: Searched first; then folders above the file, ROS_PACKAGE_PATH, the installed example-robot-data.
        inertia: True if inertia boxes are shown; notes then report boxes that are not drawn as described.

    Returns:
        Pieces and notes; missing and damaged meshes are replaced and noted, and do not raise errors.
    """
    artist = _Artist(robot, package_dirs)
    pieces = artist.upright(artist.robot_pieces)
    boxes = []
    for link, pose, mesh, doubt in inertia_boxes(robot):
        boxes.append(Piece(link, pose, mesh, _DOUBTFUL if doubt else _INERTIA))
        if doubt and inertia:
            artist.notes.append(f"inertia box of link {link!r}: {doubt}, in red; correct its <inertia>")
    estimated = [f"{robot.name}: {text}" for text in estimated_links(robot.description)]
    remarks = (*artist.remarks, *artist.elsewhere, *estimated)
    return Drawing(tuple(pieces), tuple(dict.fromkeys(artist.notes)), remarks, tuple(boxes))


def solids(
    robot: Robot, package_dirs: Iterable[str | Path] = (), kinds: tuple[str, ...] = ("collision", "visual"),
    links: Container[str] | None = None,
) -> tuple[dict[str, tuple[Piece, ...]], tuple[str, ...]]:  # fmt: skip
    """Return the shapes of each link, of the first kind with a readable shape; and notes on unreadable ones.

    The notes state the addresses of meshes as written; a note on "file" reports meshes read from other files.

    Args:
        robot: The robot.
        package_dirs: See `drawing`.
        kinds: The elements, in this order.
        links: Names of links; by default all.
    """
    artist = _Artist(robot, package_dirs, as_written)
    found = artist.upright(lambda: artist.link_solids(kinds, links))
    return found, (*dict.fromkeys(artist.notes), *(f"file: {remark}" for remark in artist.elsewhere))


class _Artist:
    """Draws one robot; stores its meshes, its named materials and its notes."""

    def __init__(
        self, robot: Robot, package_dirs: Iterable[str | Path], shown: Callable[[str | None], str] = shown
    ) -> None:
        self.shown = shown  # the text of an address in notes
        self.name, self.source = robot.name, Path(robot.description.source)
        self.element, _ = parse(robot.description.text, robot.description.source)
        self.checked = {link.get("name"): link for link in robot.description.element.iterfind("link")}
        self.notes, self.remarks, self.elsewhere = list[str](), list[str](), list[str]()
        self.file = partial(find_file, source=self.source, package_dirs=tuple(package_dirs), remarks=self.elsewhere)
        self._turned = frozenset({meshes.GLTF})  # formats whose files with y up are turned to z up
        self._y_up: list[tuple[str, str, ndarray, Mesh]] = []  # format, link, pose and mesh of these files
        self._read = cache(meshes.read)  # so that pieces of one file share their meshes
        self._primitive = cache(lambda tag, lengths: PRIMITIVES[tag](*lengths))
        self._texture = cache(lambda path: meshes.png(mesh_files.bounded(path)))
        # As in urdfdom: a name means its first definition, those of the top level before those of the links.
        self._materials: dict[str, Any] = {}
        for material in (*self.element.iterfind("material"), *self.element.iterfind("link/visual/material")):
            if (name := material.get("name")) and len(material):
                self._materials.setdefault(name, material)

    def robot_pieces(self) -> list[Piece]:
        links = self.links()
        if self.element.find("link/visual") is not None:
            return [piece for name, link in links for piece in self.visuals(name, link)]
        pieces = [piece for name, link in links for piece in self.stand_in(name, link)[0]]
        what = "its collision shapes and inertia ellipsoids are drawn; add <visual> elements to see more"
        self.remarks.append(f"{self.name}: no link has a <visual>; {what}")
        return pieces

    def links(self) -> list[tuple[str, Any]]:
        """Return the links of the robot by name, without links that no joint connects to it."""
        named = [((link.get("name") or "").strip(), link) for link in self.element.iterfind("link")]
        return [(name, link) for name, link in named if name in self.checked]

    def upright(self, draw: Callable[[], T]) -> T:
        """Return a drawing; redraw with the other up axis if meshes of files with y up are then nearer to masses."""
        drawn = draw()
        wrong = frozenset(kind for kind in _Y_UP_REMARKS if self._nearer_the_other_way(kind))
        if not wrong:
            return drawn
        self._turned ^= wrong
        self.remarks += [f"{self.name}: {_Y_UP_REMARKS[kind]}" for kind in sorted(wrong)]
        return draw()

    def _nearer_the_other_way(self, kind: str) -> bool:
        R = meshes.Z_UP.T if kind in self._turned else meshes.Z_UP
        turn, here, there = homogeneous(R, np.zeros(3)), 0.0, 0.0
        for file_format, name, pose, mesh in self._y_up:
            for origin in self.checked[name].iterfind("inertial/origin") if file_format == kind else ():
                com = np.array(origin.get("xyz").split(), dtype=float)  # checked by the hardened read
                here += off_centre(mesh, pose, com)
                there += off_centre(mesh, pose @ turn, com)
        return there < 0.6 * here

    def link_solids(self, kinds: tuple[str, ...], links: Container[str] | None) -> dict[str, tuple[Piece, ...]]:
        """Return the shapes of links, of the first kind with a readable shape."""
        found: dict[str, tuple[Piece, ...]] = {}
        for name, link in self.links():
            for kind in kinds if links is None or name in links else ():
                if not found.get(name):
                    pieces, failed = self.shapes(name, link, kind)
                    found[name] = tuple(pieces)
                    self.notes += [f"link {name!r}: <{kind}>: {why}" for why in failed]
        return found

    def visuals(self, name: str, link: Any) -> list[Piece]:
        """Return the pieces of the visuals of a link, and a replacement for those that cannot be read."""
        pieces, failed = self.shapes(name, link, "visual")
        if failed:
            substitute, what = self.stand_in(name, link)
            pieces += substitute
            self.notes += [f"link {name!r}: {why}; {what} drawn in its place" for why in failed]
        return pieces

    def stand_in(self, name: str, link: Any) -> tuple[list[Piece], str]:
        """Return the readable collision shapes of a link, otherwise the ellipsoid of its inertia; and its name."""
        pieces, failed = self.shapes(name, link, "collision", _STAND_IN)
        if link.find("visual") is None:  # otherwise the note on the visual stands for both
            self.notes += [f"link {name!r}: <collision>: {why}" for why in failed]
        if pieces:
            return pieces, "the collision shape is"
        inertial = self.checked[name].find("inertial")
        if inertial is None or not (mass := float(inertial.find("mass").get("value"))):
            return [], "the link has no collision shape and no mass, so nothing is"
        moment = {key: float(value) for key, value in inertial.find("inertia").items()}
        inertia = np.array([[moment[f"i{min(i, j)}{max(i, j)}"] for j in "xyz"] for i in "xyz"])
        mesh, axes = inertia_ellipsoid(mass, inertia)
        pose = self.pose(name, inertial) @ homogeneous(axes, np.zeros(3))
        return [Piece(name, pose, mesh, _STAND_IN)], "the ellipsoid of its inertia is"

    def shapes(self, name: str, link: Any, kind: str, color: Rgba | None = None) -> tuple[list[Piece], list[str]]:
        """Return the pieces of all readable shapes of a kind, and the reasons why others cannot be read."""
        pieces, failed = [], []
        for element in link.iterfind(kind):
            try:
                pieces += self.shape(name, element, color)
            except MeshError as error:
                failed.append(str(error))
        return pieces, failed

    def shape(self, name: str, element: Any, color: Rgba | None) -> list[Piece]:
        """Return the pieces of a <visual> or <collision>."""
        pose, (stated, texture) = self.pose(name, element), self.material(name, element)
        shape = elements.shape(element)
        if shape.tag == "mesh":
            parts = self.mesh(shape)
        else:
            parts = (Part(self._primitive(shape.tag, elements.lengths(shape))),)
        self._y_up += [(part.y_up, name, pose, part.mesh) for part in parts if part.y_up]
        pieces = []
        for part in parts:  # as in rviz, a material of the mesh file wins over that of the URDF [robot_link.cpp]
            of_urdf = color or stated or GREY, None if part.mesh.uv is None else texture
            look = of_urdf if part.rgba is None else (part.rgba, part.image)
            pieces.append(Piece(name, pose, part.mesh, *look))
        return pieces

    def mesh(self, element: Any) -> tuple[Part, ...]:
        address = element.get("filename")
        scale = elements.numbers(element, "scale", 3, "1 1 1")
        try:
            parts, complaints = self._read(self.file(address), scale, self._turned)
        except MeshError as error:
            raise MeshError(f"mesh {self.shown(address)}: {error}") from None
        if element.get("materials") == "ignored":  # MJCF: geoms state the colour
            return tuple(replace(part, rgba=None, image=None) for part in parts)
        self.notes += [f"mesh {self.shown(address)}: {complaint}; drawn without it" for complaint in complaints]
        return parts

    def pose(self, name: str, element: Any) -> ndarray:
        try:
            return elements.pose(element)
        except MeshError as error:
            self.notes.append(f"link {name!r}: {error}; drawn at the origin of the link")
            return np.eye(4)

    def material(self, name: str, element: Any) -> tuple[Rgba | None, bytes | None]:
        """Return colour and texture that a visual names, or None."""
        material = element.find("material")
        if material is None:
            return None, None
        material = self._materials.get(material.get("name") or "", material)
        color, texture = material.find("color"), material.find("texture")
        address = None if texture is None else texture.get("filename")
        try:
            if address:
                return WHITE, self._texture(self.file(address))
            if color is not None:
                r, g, b, a = (min(max(x, 0.0), 1.0) for x in elements.numbers(color, "rgba", 4))
                return (r, g, b, a), None
        except MeshError as error:
            what = f"texture {self.shown(address)}" if address else "material"
            self.notes.append(f"link {name!r}: {what}: {error}; drawn without it")
        return None, None
