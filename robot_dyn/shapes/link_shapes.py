"""Shape of a link as bodies of density 1, from its <collision> elements, or else from its <visual> elements.

A box, cylinder or sphere is exact; a closed mesh is its enclosed solid; an open mesh is its convex hull. Elements are
summed even where they overlap, for example the cylinder and the two spheres of a capsule.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple, final

import numpy as np

from robot_dyn.description.description import Description
from robot_dyn.description.inertia import MassProperties, combined
from robot_dyn.description.markup import parse
from robot_dyn.shapes import elements, meshes, primitives, surface
from robot_dyn.shapes.addresses import as_written, find_file
from robot_dyn.shapes.mesh_files import MeshError


class _Bodies(NamedTuple):
    """Bodies of one element; None if it has no volume.

    Attributes:
        solid, hull, shell: See `LinkShape`.
        closed: False if the solid is a convex hull because the mesh is open.
        flipped_parts: Number of parts whose faces were inside out and were flipped.
    """

    solid: MassProperties | None
    hull: MassProperties | None
    shell: MassProperties | None
    closed: bool
    flipped_parts: int = 0


@final
@dataclass(frozen=True, eq=False)
class LinkShape:
    """The shape of a link, in its frame.

    Attributes:
        solid: Primitives, closed meshes, and the convex hulls of open meshes; at 1 kg/m³.
        hull: Convex hulls of all elements; at 1 kg/m³.
        shell: Surfaces of all elements; at 1 kg/m².
        origin: Elements used, as text, for example "open collision mesh, by its convex hull".
    """

    solid: MassProperties
    hull: MassProperties
    shell: MassProperties
    origin: str


def link_shapes(
    description: Description,
    links: Iterable[str],
    package_dirs: tuple[str | Path, ...] = (),
    *,
    allow_overlap: bool = False,
) -> tuple[dict[str, LinkShape], dict[str, str]]:
    """Return the shapes of links, and the errors of links whose stated shape cannot be read.

    Args:
        description: The robot's file; meshes are searched as in `rd.show`.
        links: Names of the links.
        package_dirs: Folders searched first.
        allow_overlap: Accept closed parts of a mesh that overlap, and count the shared volume once for each part.

    Returns:
        Shape by link, without links that have no shape or only primitives of length 0; and error message by link.
    """
    root, _ = parse(description.text, description.source)
    stated = {(link.get("name") or "").strip(): link for link in root.iterfind("link")}
    reader = _Reader(Path(description.source), package_dirs, allow_overlap)
    shapes, errors = dict[str, LinkShape](), dict[str, str]()
    for name in links:
        reasons = []
        for kind in ("collision", "visual"):
            of_kind = [*stated[name].iterfind(kind)] if name in stated else []
            try:
                if of_kind and (shape := reader.shape(kind, of_kind)) is not None:
                    shapes[name] = shape
                    break
            except MeshError as error:
                reasons.append(f"<{kind}>: {error}")
        if name not in shapes and reasons:
            errors[name] = reasons[0]
    return shapes, errors


class _Reader:
    """Reader of the shapes of one file, which reads each mesh once."""

    def __init__(self, source: Path, package_dirs: tuple[str | Path, ...], allow_overlap: bool) -> None:
        self.remarks: list[str] = []  # remarks on the current shape
        self.file = partial(find_file, source=source, package_dirs=package_dirs, remarks=self.remarks)
        self._mesh = cache(partial(_of_mesh, allow_overlap=allow_overlap))

    def shape(self, kind: str, stated: list[Any]) -> LinkShape | None:
        """Return the combined bodies of all elements of a kind; None if all are primitives with a length of 0.

        Raises:
            MeshError: If one cannot be read, or none has a volume and one is a mesh.
        """
        self.remarks.clear()
        read = [self.bodies(element) for element in stated]
        solid, hull, shell = (
            [body for bodies in read if (body := getattr(bodies, key)) is not None]
            for key in ("solid", "hull", "shell")
        )
        if not hull:
            flat = next((shape for element in stated if (shape := elements.shape(element)).tag == "mesh"), None)
            if flat is None:
                return None
            raise MeshError(
                f"mesh {as_written(flat.get('filename'))}: is flat and encloses no volume; export a closed surface,"
                " use a box, or add an <inertial>"
            )
        # no folder names: the text becomes a comment in the file, which may be published
        elsewhere = ", in a file of the same name instead of the stated one" if self.remarks else ""
        return LinkShape(combined(solid), combined(hull), combined(shell), _origin(kind, stated, read) + elsewhere)

    def bodies(self, element: Any) -> _Bodies:
        """Return the bodies of one element, in the frame of the link."""
        shape, placement = elements.shape(element), elements.pose(element)
        R, p = placement[:3, :3], placement[:3, 3]
        own = self.mesh(shape) if shape.tag == "mesh" else _of_primitive(shape)
        solid, hull, shell = (None if body is None else body.moved(R, p) for body in own[:3])
        return _Bodies(solid, hull, shell, own.closed, own.flipped_parts)

    def mesh(self, element: Any) -> _Bodies:
        address = element.get("filename")
        try:
            return self._mesh(self.file(address), elements.numbers(element, "scale", 3, "1 1 1"))
        except MeshError as error:
            raise MeshError(f"mesh {as_written(address)}: {error}") from None


def _of_mesh(path: Path, scale: tuple[float, ...], allow_overlap: bool) -> _Bodies:
    """Return the bodies of a mesh file, all of its materials together."""
    corners = meshes.corners(path, scale)
    vertices, faces = corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
    if (hull := surface.hull(vertices)) is None:
        return _Bodies(None, None, None, False)
    solid = surface.solid(vertices, faces, allow_overlap=allow_overlap)
    shell = surface.shell(vertices, faces)
    if solid is None:
        return _Bodies(hull, hull, shell, False)
    return _Bodies(solid.body, hull, shell, True, solid.flipped_parts)


def _of_primitive(shape: Any) -> _Bodies:
    """Return the bodies of a primitive; none if a length is 0, which exporters use to mark frames."""
    if elements.is_empty(shape):
        return _Bodies(None, None, None, True)
    lengths = elements.lengths(shape)
    solid = primitives.solid(shape.tag, lengths)
    return _Bodies(solid, solid, primitives.shell(shape.tag, lengths), True)


def _origin(kind: str, stated: list[Any], read: list[_Bodies]) -> str:
    """Describe the elements of a shape."""
    tags = [elements.shape(element).tag for element in stated]
    closed_meshes = [bodies.closed for tag, bodies in zip(tags, read, strict=True) if tag == "mesh"]
    words = [f"{kind} {tag}" for tag in dict.fromkeys(tags) if tag != "mesh"]
    if closed := sum(closed_meshes):
        words.append(f"closed {kind} mesh" + "es" * (closed > 1))
    if number := len(closed_meshes) - sum(closed_meshes):
        words.append(f"open {kind} mesh" + ("es, by their convex hulls" if number > 1 else ", by its convex hull"))
    if turned := sum(bodies.flipped_parts for bodies in read):
        words[-1] += f" ({turned} part{'s' * (turned > 1)} flipped: faces were inside out)"
    return " and ".join(words)
