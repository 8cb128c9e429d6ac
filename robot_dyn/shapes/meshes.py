"""Mesh files as plain triangles: one mesh for each material, creased normals, equal corners merged.

The nodes of a scene are applied, and a Collada `<unit>`. In glTF y is up, by its specification; it is turned to z up,
before the scale of the URDF, as in Drake and rviz. A Collada `<up_axis>` is not followed, as in rviz, but reported, as
Gazebo follows it. STL, OBJ and PLY have no axis. [rviz, mesh_loader.cpp; drake, internal_render_engine_vtk.cc]
"""

from __future__ import annotations

import io
import logging
import re
import struct
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]
from numpy import ndarray

from robot_dyn.foundations.errors import shorten
from robot_dyn.shapes.mesh_files import MeshError, beside, bounded, check_gltf, checked_collada
from robot_dyn.shapes.triangles import Mesh, welded

MAX_PIXELS = 1024  # of a texture's longer side in the page
FORMATS = ("stl", "dae", "obj", "ply", "glb", "gltf")
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])  # of a binary STL file
_HEADER = 84  # bytes of it: 80 of text and the count
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
_BAD_NORMAL = re.compile(rb"\bnormal\b(?!(?:\s+[-+.\deE]+|\s+[-+]?(?:nan|inf)){3}\s)", re.IGNORECASE)
COLLADA, GLTF = "Collada", "glTF"  # the formats with files in which y is up
Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # from y up: a quarter turn about x

Rgba = tuple[float, float, float, float]
WHITE: Rgba = (1.0, 1.0, 1.0, 1.0)
Node = tuple[ndarray, ndarray | None, Any]  # corners and normals (m, 3, 3), and what trimesh holds of it, not of STL


@final
@dataclass(frozen=True, eq=False)
class Part:
    """The triangles of a file that share one material.

    Attributes:
        mesh: The triangles, scaled, in the frame of the file or turned to z up.
        rgba: Their colour, or None if the file gives them none.
        image: Their texture as PNG, or None.
        y_up: The format of a file that says that y is up, else None.
    """

    mesh: Mesh
    rgba: Rgba | None = None
    image: bytes | None = None
    y_up: str | None = None


def read(
    path: Path, scale: Any = (1.0, 1.0, 1.0), turned: frozenset[str] = frozenset({GLTF})
) -> tuple[tuple[Part, ...], tuple[str, ...]]:
    """Read the triangles of a mesh file, scaled; faces are flipped where the scale is a mirror image.

    Args:
        path: The file.
        scale: Factors along the axes of the shape, after a turn.
        turned: The formats whose files, where they say that y is up, are turned to z up.

    Returns:
        The parts, and what of their materials and textures cannot be read.

    Raises:
        MeshError: If there is no such file, or it is too large, damaged, empty or of another format.
    """
    missing: list[str] = []
    with _reading(missing):
        nodes, y_up = _nodes(path, np.array(scale, dtype=float), turned, missing)
        parts = tuple(_parts(nodes, missing, y_up))
    if not parts:
        raise MeshError("holds no triangles; export it again")
    return parts, tuple(dict.fromkeys(missing))


def corners(path: Path, scale: Any = (1.0, 1.0, 1.0)) -> ndarray:
    """Read the corners of the triangles of a mesh file where `read` has them, with all the digits of the file.

    Args:
        path: The file.
        scale: Factors along the axes of the shape, after a turn; faces are flipped where it is a mirror image.

    Returns:
        (m, 3, 3) float64, in [m], without triangles that are not finite.

    Raises:
        MeshError: See `read`.
    """
    with _reading([]):
        nodes, _ = _nodes(path, np.array(scale, dtype=float), frozenset({GLTF}), [], "f8")
        found = np.concatenate([np.zeros((0, 3, 3)), *(placed for placed, _, _ in nodes)])
        found = found[np.isfinite(found).all(axis=(1, 2))]
    if not len(found):
        raise MeshError("holds no triangles; export it again")
    return found


@contextmanager
def _reading(missing: list[str]) -> Iterator[None]:
    """Raise MeshError for anything that a reader raises, and silence its warnings."""
    try:
        with warnings.catch_warnings(action="ignore"), _logged(missing):  # of numpy and Pillow, on what is refused here
            yield
    except MeshError:
        raise
    except Exception as error:  # a damaged file makes the readers raise anything
        raise MeshError(f"is damaged ({type(error).__name__}: {shorten(error, 120)}); export it again") from None


def _stl(data: bytes, missing: list[str], digits: str) -> ndarray:
    """Corners (m, 3, 3) of the triangles of an STL file, as floats of a type; stated normals are not used.

    A normal that is not three numbers is added to `missing`.

    Raises:
        ValueError: If it is cut off, or a corner is not three numbers.
    """
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= _HEADER else 0
    stated = _HEADER + count * _RECORD.itemsize
    ascii_ = data.lstrip()[:5].lower() == b"solid" and stated != len(data)  # exporters write "solid" in binary ones too
    if not ascii_:
        if stated > len(data):
            raise ValueError(f"it states {count} triangles and holds {(len(data) - _HEADER) // _RECORD.itemsize}")
        return np.frombuffer(data, _RECORD, count, _HEADER)["corners"].astype(digits)
    if _BAD_NORMAL.search(data):
        missing.append("a normal is not three numbers")
    corners = np.fromiter((float(word) for match in _VERTEX.finditer(data) for word in match.groups()), digits)
    if len(corners) % 9:
        raise ValueError("a facet has not three corners")
    return corners.reshape(-1, 3, 3)


@contextmanager
def _logged(missing: list[str]) -> Iterator[None]:
    """Add what trimesh logs, which would go to stderr with a traceback, to what cannot be read."""
    logger = logging.getLogger("trimesh")
    handler = logging.Handler(logging.WARNING)
    handler.emit = lambda record: missing.append(f"its reader says: {shorten(record.getMessage(), 120)}")
    logger.addHandler(handler)
    propagate, logger.propagate = logger.propagate, False
    try:
        yield
    finally:
        logger.propagate = propagate
        logger.removeHandler(handler)


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


def _scene(data: bytes, kind: str, folder: Path, missing: list[str]) -> tuple[Any, float, str | None]:
    """What trimesh reads, nothing merged; the unit of its lengths in [m]; and its format if it says that y is up."""
    import trimesh

    named = beside(folder, missing, anywhere=kind not in ("glb", "gltf"))  # textures often stand in ../textures
    choices = {"file_type": kind, "resolver": named, "process": False}
    if kind in ("glb", "gltf"):
        check_gltf(data, named)
        return trimesh.load_scene(io.BytesIO(data), **choices), 1.0, GLTF
    if kind != "dae":
        return trimesh.load_scene(io.BytesIO(data), **choices), 1.0, None
    root = checked_collada(data)
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
    y_up = root.findtext("{*}asset/{*}up_axis", "").strip() == "Y_UP"
    return scene, metres if 0 < metres < np.inf else 1.0, COLLADA if y_up else None


def _parts(nodes: Iterable[Node], missing: list[str], y_up: str | None) -> Iterator[Part]:
    """One part for each material, from all nodes that wear it."""
    groups: dict[tuple[Any, ...], list[tuple[Any, ...]]] = {}
    images: dict[int, bytes | None] = {}
    for corners, normals, geometry in nodes:
        rgba, picture, *columns = _look(geometry)
        if picture is not None and id(picture) not in images:
            try:
                images[id(picture)] = png(picture)
            except MeshError as error:
                images[id(picture)] = missing.append(f"a texture {error}")
        image = None if picture is None else images[id(picture)]
        key = (rgba, image, normals is None, *(column is None for column in columns))
        groups.setdefault(key, []).append((corners, normals, *columns))
    for (rgba, image, *_), pieces in groups.items():
        columns: Any = pieces[0]
        if len(pieces) > 1:
            columns = [None if each[0] is None else np.concatenate(each) for each in zip(*pieces, strict=True)]
        if (mesh := welded(*columns)) is not None:
            yield Part(mesh, rgba, image, y_up)


def _nodes(
    path: Path, factors: ndarray, turned: frozenset[str], missing: list[str], digits: str = "f4"
) -> tuple[Iterable[Node], str | None]:
    """Return the scaled nodes of a mesh file, and its format if y is up in it; STL has the type of `digits`."""
    kind, data = path.suffix.lower().removeprefix("."), bounded(path)
    if kind not in FORMATS:
        raise MeshError(f"its format {path.suffix!r} is not read; convert it to {', '.join(FORMATS)}")
    if kind == "stl":
        corners = _stl(data, missing, digits)
        np.multiply(corners, factors, out=corners, casting="unsafe")
        return [(corners[:, ::-1] if np.prod(factors) < 0 else corners, None, None)], None
    scene, unit, y_up = _scene(data, kind, path.parent, missing)
    A = unit * factors[:, None] * (Z_UP if y_up in turned else np.eye(3))
    places = ((scene.graph[node][0], scene.geometry[scene.graph[node][1]]) for node in scene.graph.nodes_geometry)
    has_faces = ((g, geometry) for g, geometry in places if len(getattr(geometry, "faces", ())))  # not lines and points
    return ((*_placed(geometry, A @ g[:3]), geometry) for g, geometry in has_faces), y_up


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
    if geometry is None:
        return None, None, None, None
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
