"""Mesh files as plain triangles: one mesh for each material, creased normals, equal corners merged.

Coordinates are read as rviz and coal read them: the nodes of a scene are applied, a Collada `<unit>` is applied, and
`<up_axis>` (like the y-up of glTF) is not, but told: Gazebo applies it. [rviz, mesh_loader.cpp]
"""

from __future__ import annotations

import io
import json
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PureWindowsPath
from stat import S_ISREG
from typing import Any, final

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]
from numpy import ndarray

from robot_dyn.errors import RobotDynError, shorten
from robot_dyn.view.geometry.triangles import Mesh, welded

MAX_BYTES = 64 * 2**20  # of one mesh or texture; the largest of example-robot-data has 28 MiB
MAX_NODES = 20_000  # of a scene when every instance is counted
MAX_PIXELS = 1024  # of a texture's longer side in the page
FORMATS = ("stl", "dae", "obj", "ply", "glb")

Rgba = tuple[float, float, float, float]
WHITE: Rgba = (1.0, 1.0, 1.0, 1.0)


class MeshError(RobotDynError):
    """A shape or texture that cannot be drawn; the message says why, and follows the name of its file or link."""


@final
@dataclass(frozen=True, eq=False)
class Part:
    """The triangles of a file that share one material.

    Attributes:
        mesh: The triangles, scaled, in the frame of the file.
        rgba: Their colour, or None if the file gives them none.
        image: Their texture as PNG, or None.
        y_up: Whether the file says that y is up; its coordinates are not turned.
    """

    mesh: Mesh
    rgba: Rgba | None = None
    image: bytes | None = None
    y_up: bool = False


def read(path: Path, scale: Any = (1.0, 1.0, 1.0)) -> tuple[tuple[Part, ...], tuple[str, ...]]:
    """The triangles of a mesh file, each coordinate times its scale (3,); in a mirror image the outside stays outside.

    Returns:
        The parts, and what of their materials and textures cannot be read.

    Raises:
        MeshError: If there is no such file, or it is too large, damaged, empty or of another format.
    """
    data, kind, missing = bounded(path), path.suffix.lower().removeprefix("."), []
    if kind not in FORMATS:
        raise MeshError(f"its format {path.suffix!r} is not read; convert it to {', '.join(FORMATS)}")
    try:
        with warnings.catch_warnings(action="ignore"):  # of numpy and Pillow, on what is refused below
            scene, unit, y_up = _scene(data, kind, path.parent, missing)
            parts = tuple(_parts(scene, unit * np.array(scale, dtype=float), missing, kind != "stl", y_up))
    except MeshError:
        raise
    except Exception as error:  # a damaged file makes the readers raise anything
        raise MeshError(f"is damaged ({type(error).__name__}: {shorten(error, 120)}); export it anew") from None
    if not parts:
        raise MeshError("holds no triangles; export it anew")
    return parts, tuple(dict.fromkeys(missing))


def bounded(path: Path) -> bytes:
    """The bytes of a regular file of at most `MAX_BYTES`; MeshError if it is none."""
    try:
        status = path.stat()
        if not S_ISREG(status.st_mode):
            raise MeshError("is no regular file")
        if status.st_size > MAX_BYTES:
            raise MeshError(f"has {status.st_size / 2**20:.0f} MiB, the limit is {MAX_BYTES >> 20}; simplify it")
        return path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise MeshError(f"cannot be read ({getattr(error, 'strerror', error)})") from None


def png(picture: Any) -> bytes:
    """A picture, as bytes or as Pillow holds it, as PNG of at most `MAX_PIXELS` a side; MeshError if it is damaged."""
    from PIL import Image

    try:
        with warnings.catch_warnings(action="ignore"):  # Pillow warns of the size that is checked here
            image = Image.open(io.BytesIO(picture)) if isinstance(picture, bytes) else picture
            if image.width * image.height > 2**26:
                raise MeshError(f"has {image.width} by {image.height} pixels; make it smaller")
            image = image.convert("RGBA" if image.has_transparency_data else "RGB")
            image.thumbnail((MAX_PIXELS, MAX_PIXELS))
            image.save(out := io.BytesIO(), "PNG")
            return out.getvalue()
    except MeshError:
        raise
    except Exception as error:  # Pillow reads late, and raises anything
        raise MeshError(f"is damaged ({type(error).__name__}: {shorten(error, 80)})") from None


def _scene(data: bytes, kind: str, folder: Path, missing: list[str]) -> tuple[Any, float, bool]:
    """What trimesh reads, nothing merged; the unit of its lengths in [m]; and whether it says that y is up."""
    import trimesh

    choices = {"file_type": kind, "resolver": _beside(folder, missing), "process": False}
    if kind == "glb":
        _check_gltf(data)
    if kind != "dae":
        return trimesh.load_scene(io.BytesIO(data), **choices), 1.0, False
    root = _checked_collada(data)
    unit = root.find("{*}asset/{*}unit")
    try:
        metres = float("1" if unit is None else unit.get("meter", "1"))
    except ValueError:
        metres = 1.0  # as rviz takes a unit it cannot read
    try:
        scene = trimesh.load_scene(io.BytesIO(etree.tostring(root)), **choices, ignore_broken=False)
    except Exception as error:  # with broken materials left in, trimesh drops their triangles in silence
        missing.append(f"part of it is damaged ({shorten(error, 120)})")
        for each in (*root.iterfind(".//{*}bind_material"), *root.iterfind("{*}library_effects")):
            each.getparent().remove(each)
        scene = trimesh.load_scene(io.BytesIO(etree.tostring(root)), **choices)
    return scene, metres if 0 < metres < np.inf else 1.0, root.findtext("{*}asset/{*}up_axis", "").strip() == "Y_UP"


def _checked_collada(data: bytes) -> etree._Element:
    """The document, if it has no DTD, and no instances of instances beyond number."""
    first, prolog = None, etree.XMLPullParser(events=("start",), resolve_entities=False, no_network=True)
    for start in range(0, len(data), 2**12):
        prolog.feed(data[start : start + 2**12])
        if first := next(iter(prolog.read_events()), None):
            break
    if first and first[1].getroottree().docinfo.internalDTD is not None:
        raise MeshError("declares a document type (<!DOCTYPE …>), through which it can read other files; remove it")
    # geometry exceeds the limits on texts; they are lifted where no entity can be declared any more
    root = etree.fromstring(data, etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=True))
    named = {f"#{node.get('id')}": node for node in root.iterfind(".//{*}node[@id]")}

    @cache
    def size(url: str) -> int:
        return count(named[url]) if url in named else 0

    def count(node: etree._Element) -> int:
        return 1 + sum(
            size(child.get("url", "")) if child.tag.endswith("}instance_node") else count(child)
            for child in node.iterchildren("{*}node", "{*}instance_node", "{*}instance_geometry")
        )

    if sum(count(scene) for scene in root.iterfind("{*}library_visual_scenes/{*}visual_scene")) > MAX_NODES:
        raise MeshError(f"draws more than {MAX_NODES} nodes when its instances are counted; simplify it")
    return root


def _check_gltf(data: bytes) -> None:
    """Refuse accessors that claim more than the file holds: the reader would make arrays of zeros of that size."""
    head = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    if sum(each["count"] for each in head.get("accessors", ())) > len(data):
        raise MeshError("claims more vertices than it has bytes; export it anew")


def _beside(folder: Path, missing: list[str]) -> Any:
    """What a mesh may open by name: regular files of bounded size, found from its folder; the others are noted."""
    from trimesh.resolvers import FilePathResolver

    class Beside(FilePathResolver):
        def get(self, name: str) -> bytes:
            try:
                return bounded(folder / name.strip().removeprefix("file://").replace("\\", "/"))
            except MeshError as error:
                missing.append(f"{shorten(PureWindowsPath(name).name)} {error}")  # folders are nobody's business
                raise

    return Beside(str(folder), allow_anywhere=True)  # textures often stand in ../textures


def _parts(scene: Any, scale: ndarray, missing: list[str], coloured: bool, y_up: bool) -> Iterator[Part]:
    """One part for each material, from all nodes of the scene that wear it."""
    groups: dict[tuple[Any, ...], list[tuple[Any, ...]]] = {}
    images: dict[int, bytes | None] = {}
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        geometry = scene.geometry[name]
        if not len(getattr(geometry, "faces", ())):
            continue  # lines and points
        corners, normals = _placed(geometry, scale[:, None] * transform[:3])
        rgba, picture, *columns = _look(geometry) if coloured else (None,) * 4
        if picture is not None and id(picture) not in images:
            try:
                images[id(picture)] = png(picture)
            except MeshError as error:
                images[id(picture)] = missing.append(f"a texture {error}")
        image = None if picture is None else images[id(picture)]
        key = (rgba, image, normals is None, *(column is None for column in columns))
        groups.setdefault(key, []).append((corners, normals, *columns))
    for (rgba, image, *_), pieces in groups.items():
        columns: Any = [None if each[0] is None else np.concatenate(each) for each in zip(*pieces, strict=True)]
        if (mesh := welded(*columns)) is not None:
            yield Part(mesh, rgba, image, y_up)


def _placed(geometry: Any, A: ndarray) -> tuple[ndarray, ndarray | None]:
    """Corners and their normals (or None), (m, 3, 3), after x ↦ A x, turned over where A mirrors."""
    mirrors = np.linalg.det(A[:, :3]) < 0
    faces = np.asarray(geometry.faces)[:, :: -1 if mirrors else 1]
    corners = (np.asarray(geometry.vertices) @ A[:, :3].T + A[:, 3])[faces]
    if "vertex_normals" not in geometry._cache:  # trimesh would make some up, smooth across edges
        return corners, None
    x, y, z = A[:, :3]
    cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)])  # det A · A⁻ᵀ
    return corners, (-1 if mirrors else 1) * (np.asarray(geometry.vertex_normals) @ cofactors.T)[faces]


def _look(geometry: Any) -> tuple[Rgba | None, Any, ndarray | None, ndarray | None]:
    """Colour, picture, texture coordinates and colours of the corners, each None where the file has none."""
    visual, faces = geometry.visual, np.asarray(geometry.faces)
    if visual.kind in ("vertex", "face"):
        index = faces if visual.kind == "vertex" else np.arange(len(faces))[:, None].repeat(3, axis=1)
        return WHITE, None, None, np.asarray(getattr(visual, f"{visual.kind}_colors"))[index][..., :3]
    if visual.kind != "texture":
        return None, None, None, None
    material = visual.material
    uv = None if visual.uv is None or len(visual.uv) != len(geometry.vertices) else np.asarray(visual.uv)[faces]
    if hasattr(material, "baseColorFactor"):  # Collada and glTF
        rgba, picture = _rgba(material.baseColorFactor), material.baseColorTexture
    else:
        rgba, picture = _rgba(material.diffuse), material.image
        if picture is not None and "file_path" not in picture.info:
            return None, None, uv, None  # the stand-in trimesh gives to an OBJ that names no material
        rgba = rgba if picture is None else WHITE  # trimesh takes grey for a colour that is not stated
    return (rgba, picture, uv, None) if picture is not None and uv is not None else (rgba, None, None, None)


def _rgba(color: Any) -> Rgba:
    """The colour of a material. One without any opacity is drawn opaque: exporters mean both 0 and 1 by opaque."""
    r, g, b, a = (1.0, 1.0, 1.0, 1.0) if color is None else (float(value) / 255 for value in color)
    return r, g, b, a if a > 0 else 1.0
