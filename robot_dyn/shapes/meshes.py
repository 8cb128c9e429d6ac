"""Mesh files as plain triangles: one mesh per material, creased normals, equal corners merged.

The transforms of a scene and a Collada `<unit>` are applied. glTF specifies y up: it is rotated to z up before the
scale of the URDF is applied, as in Drake and rviz. A Collada `<up_axis>` is ignored, as in rviz, but reported, because
Gazebo applies it. STL, OBJ and PLY have no up axis. [rviz, mesh_loader.cpp; drake, internal_render_engine_vtk.cc]
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
from typing import TYPE_CHECKING, Any, final

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]
from numpy import ndarray

from robot_dyn.foundations.errors import shorten
from robot_dyn.shapes.mesh_files import MeshError, beside, bounded, check_gltf, checked_collada
from robot_dyn.shapes.triangles import Mesh, welded

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from PIL import Image


MAX_PIXELS = 1024  # largest side of a texture in the page
FORMATS = ("stl", "dae", "obj", "ply", "glb", "gltf")
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])  # triangle of binary STL
_HEADER = 84  # bytes before the records: 80 of text and the count
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
_BAD_NORMAL = re.compile(rb"\bnormal\b(?!(?:\s+[-+.\deE]+|\s+[-+]?(?:nan|inf)){3}\s)", re.IGNORECASE)
COLLADA, GLTF = "Collada", "glTF"  # formats whose files can have y up
Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # from y up: a quarter turn about x

Rgba = tuple[float, float, float, float]
WHITE: Rgba = (1.0, 1.0, 1.0, 1.0)
Node = tuple[ndarray, ndarray | None, Any]  # corners and normals (m, 3, 3), and trimesh's geometry (None for STL)


@final
@dataclass(frozen=True, eq=False)
class Part:
    """The triangles of a file that share one material.

    Attributes:
        mesh: Scaled triangles, in the frame of the file or turned to z up.
        rgba: Colour, or None if the file has none.
        image: Texture as PNG, or None.
        y_up: Format of the file if it declares y up, otherwise None.
    """

    mesh: Mesh
    rgba: Rgba | None = None
    image: bytes | None = None
    y_up: str | None = None


def read(
    path: Path, scale: ArrayLike = (1.0, 1.0, 1.0), turned: frozenset[str] = frozenset({GLTF})
) -> tuple[tuple[Part, ...], tuple[str, ...]]:
    """Read the triangles of a mesh file, scaled; faces are flipped where the scale mirrors.

    Args:
        path: The file.
        scale: Factors along the axes of the shape, after a turn to z up.
        turned: Formats whose files are turned to z up if they declare y up.

    Returns:
        The parts, and messages on unreadable materials and textures.

    Raises:
        MeshError: If there is no such file, or it is too large, damaged, empty or of another format.
    """
    missing: list[str] = []
    with _reading(missing):
        nodes, y_up = _nodes(path, np.array(scale, dtype=float), turned, missing)
        parts = tuple(_parts(nodes, missing, y_up))
    if not parts:
        raise MeshError("contains no triangles; export it again")
    return parts, tuple(dict.fromkeys(missing))


def corners(path: Path, scale: ArrayLike = (1.0, 1.0, 1.0)) -> ndarray:
    """Read the corners of the same triangles as `read`, with all digits of the file.

    Args:
        path: The file.
        scale: Factors along the axes of the shape, after a turn to z up; faces are flipped where it mirrors.

    Returns:
        Finite triangles, (m, 3, 3) float64, in [m].

    Raises:
        MeshError: See `read`.
    """
    with _reading([]):
        nodes, _ = _nodes(path, np.array(scale, dtype=float), frozenset({GLTF}), [], "f8")
        triangles = np.concatenate([np.zeros((0, 3, 3)), *(placed for placed, _, _ in nodes)])
        triangles = triangles[np.isfinite(triangles).all(axis=(1, 2))]
    if not len(triangles):
        raise MeshError("contains no triangles; export it again")
    return triangles


@contextmanager
def _reading(missing: list[str]) -> Iterator[None]:
    """Convert all exceptions of readers to MeshError, and silence their warnings."""
    try:
        # numpy and Pillow warn of content that is refused here
        with warnings.catch_warnings(action="ignore"), _logged(missing):
            yield
    except MeshError:
        raise
    except Exception as error:  # readers can raise anything on a damaged file
        raise MeshError(f"is damaged ({type(error).__name__}: {shorten(error, 120)}); export it again") from None


def _stl(data: bytes, missing: list[str], digits: str) -> ndarray:
    """Return the triangle corners (m, 3, 3) of an STL file, as floats of type `digits`; stated normals are ignored.

    A malformed normal is reported in `missing`.

    Raises:
        ValueError: If the file is truncated, or a corner is not three numbers.
    """
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= _HEADER else 0
    if not count and (rest := len(data) - _HEADER) > 0 and not rest % _RECORD.itemsize:
        count = rest // _RECORD.itemsize  # exporters that write as a stream leave the count 0
    stated = _HEADER + count * _RECORD.itemsize
    ascii_ = data.lstrip()[:5].lower() == b"solid" and stated != len(
        data
    )  # some exporters also start binary files with "solid"
    if not ascii_:
        if stated > len(data):
            raise ValueError(f"it declares {count} triangles but has {(len(data) - _HEADER) // _RECORD.itemsize}")
        return np.frombuffer(data, _RECORD, count, _HEADER)["corners"].astype(digits)
    if _BAD_NORMAL.search(data):
        missing.append("a normal is not three numbers")
    corners = np.fromiter((float(word) for match in _VERTEX.finditer(data) for word in match.groups()), digits)
    if len(corners) % 9:
        raise ValueError("a facet does not have three corners")
    return corners.reshape(-1, 3, 3)


@contextmanager
def _logged(missing: list[str]) -> Iterator[None]:
    """Add log messages of trimesh to `missing`; otherwise they would go to stderr with a traceback."""
    logger = logging.getLogger("trimesh")
    handler = logging.Handler(logging.WARNING)
    handler.emit = lambda record: missing.append(f"its reader reports: {shorten(record.getMessage(), 120)}")
    logger.addHandler(handler)
    propagate, logger.propagate = logger.propagate, False
    try:
        yield
    finally:
        logger.propagate = propagate
        logger.removeHandler(handler)


def png(picture: bytes | Image.Image) -> bytes:
    """Convert a picture, as bytes or a Pillow image, to PNG of at most `MAX_PIXELS` a side; MeshError if damaged."""
    from PIL import Image

    try:
        with warnings.catch_warnings(action="ignore"):  # Pillow warns of sizes, which are checked here
            image = Image.open(io.BytesIO(picture)) if isinstance(picture, bytes) else picture
            if image.width * image.height > 2**26:
                raise MeshError(f"has {image.width} by {image.height} pixels; make it smaller")
            image = image.convert("RGBA" if image.has_transparency_data else "RGB")
            image.thumbnail((MAX_PIXELS, MAX_PIXELS))
            image.save(out := io.BytesIO(), "PNG")
            return out.getvalue()
    except MeshError:
        raise
    except Exception as error:  # Pillow reads lazily and can raise anything
        raise MeshError(f"is damaged ({type(error).__name__}: {shorten(error, 80)})") from None


def _scene(data: bytes, kind: str, folder: Path, missing: list[str]) -> tuple[Any, float, str | None]:
    """Return trimesh's scene, nothing merged; its unit of length in [m]; and its format if it declares y up."""
    import trimesh

    resolver = beside(folder, missing, anywhere=kind not in ("glb", "gltf"))  # textures are often in ../textures
    choices = {"file_type": kind, "resolver": resolver, "process": False}
    if kind in ("glb", "gltf"):
        check_gltf(data, resolver)
        return trimesh.load_scene(io.BytesIO(data), **choices), 1.0, GLTF
    if kind != "dae":
        return trimesh.load_scene(io.BytesIO(data), **choices), 1.0, None
    root = checked_collada(data)
    unit = root.find("{*}asset/{*}unit")
    try:
        metres = float("1" if unit is None else unit.get("meter", "1"))
    except ValueError:
        metres = 1.0  # as rviz does for a malformed unit
    try:
        scene = trimesh.load_scene(io.BytesIO(etree.tostring(root)), **choices, ignore_broken=False)
    except Exception as error:  # trimesh would silently drop triangles with broken materials
        missing.append(f"part of it is damaged ({shorten(error, 120)})")
        for broken in (*root.iterfind(".//{*}bind_material"), *root.iterfind("{*}library_effects")):
            broken.getparent().remove(broken)
        scene = trimesh.load_scene(io.BytesIO(etree.tostring(root)), **choices)
    y_up = root.findtext("{*}asset/{*}up_axis", "").strip() == "Y_UP"
    return scene, metres if 0 < metres < np.inf else 1.0, COLLADA if y_up else None


def _parts(nodes: Iterable[Node], missing: list[str], y_up: str | None) -> Iterator[Part]:
    """Return one part for each material, from all nodes that use it."""
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
            columns = [None if column[0] is None else np.concatenate(column) for column in zip(*pieces, strict=True)]
        if (mesh := welded(*columns)) is not None:
            yield Part(mesh, rgba, image, y_up)


def _nodes(
    path: Path, factors: ndarray, turned: frozenset[str], missing: list[str], digits: str = "f4"
) -> tuple[Iterable[Node], str | None]:
    """Return the scaled nodes of a mesh file, and its format if it has y up; STL corners have type `digits`."""
    kind, data = path.suffix.lower().removeprefix("."), bounded(path)
    if kind not in FORMATS:
        raise MeshError(f"its format {path.suffix!r} is not supported; convert it to {', '.join(FORMATS)}")
    if kind == "stl":
        corners = _stl(data, missing, digits)
        np.multiply(corners, factors, out=corners, casting="unsafe")
        return [(corners[:, ::-1] if np.prod(factors) < 0 else corners, None, None)], None
    scene, unit, y_up = _scene(data, kind, path.parent, missing)
    A = unit * factors[:, None] * (Z_UP if y_up in turned else np.eye(3))
    places = ((scene.graph[node][0], scene.geometry[scene.graph[node][1]]) for node in scene.graph.nodes_geometry)
    has_faces = (
        (g, geometry) for g, geometry in places if len(getattr(geometry, "faces", ()))
    )  # skips lines and points
    return ((*_placed(geometry, A @ g[:3]), geometry) for g, geometry in has_faces), y_up


def _placed(geometry: Any, A: ndarray) -> tuple[ndarray, ndarray | None]:
    """Return corners and normals (or None), (m, 3, 3), after x ↦ A x; faces are flipped if A mirrors."""
    mirrors = np.linalg.det(A[:, :3]) < 0
    faces = np.asarray(geometry.faces)[:, :: -1 if mirrors else 1]
    corners = (np.asarray(geometry.vertices) @ A[:, :3].T + A[:, 3])[faces]
    if "vertex_normals" not in geometry._cache:  # trimesh would compute them, smooth across edges
        return corners, None
    x, y, z = A[:, :3]
    cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)])  # det A · A⁻ᵀ
    return corners, (-1 if mirrors else 1) * (np.asarray(geometry.vertex_normals) @ cofactors.T)[faces]


def _look(geometry: Any) -> tuple[Rgba | None, Any, ndarray | None, ndarray | None]:
    """Return colour, picture, texture coordinates and colours of the corners; None where the file has none."""
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
            return None, None, uv, None  # trimesh's placeholder for an OBJ without a material
        rgba = rgba if picture is None else WHITE  # trimesh uses grey for an unstated colour
    return (rgba, picture, uv, None) if picture is not None and uv is not None else (rgba, None, None, None)


def _rgba(color: Any) -> Rgba:
    """Return the colour of a material. Opacity 0 is drawn opaque: exporters mean both 0 and 1 by opaque."""
    r, g, b, a = (1.0, 1.0, 1.0, 1.0) if color is None else (float(value) / 255 for value in color)
    return r, g, b, a if a > 0 else 1.0
