"""Commands of meshcat's viewer as values, with NumPy arrays in them, and their text inside a page.

All commands are one compressed text, in which an array that occurs in several commands is stored once. Objects follow
three.js's JSON format 4.5.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
from typing import Any

import numpy as np

from robot_dyn.shapes.triangles import Mesh

Command = dict[str, Any]
Rgba = tuple[float, float, float, float]

_KINDS = {"position": "vector", "quaternion": "quaternion", "scale": "vector", "visible": "bool"}  # types of tracks
_DOUBLE_SIDE = 2  # meshes of real robots have triangles that face the wrong way


class Canvas:
    """The commands that draw a scene; moving nodes are at their first keyframe until the page moves them."""

    def __init__(self) -> None:
        self._commands: list[Command] = []
        self._tracks: dict[str, list[Command]] = {}

    @property
    def commands(self) -> list[Command]:
        """All commands; the animation is the last."""
        clips = [
            {"path": path, "clip": {"name": path, "fps": 1, "tracks": entry}} for path, entry in self._tracks.items()
        ]
        options = {"play": True, "repetitions": 1}
        return [*self._commands, {"type": "set_animation", "animations": clips, "options": options, "path": "replay"}]

    def mesh(self, path: str, geometry: Command, rgba: Rgba, image: bytes | None = None) -> None:
        """Add a mesh to a node, with its colour and its texture, a PNG."""
        shading = {"side": _DOUBLE_SIDE, "shininess": 30, "specular": 0x222222}
        has_colors = "color" in geometry["data"]["attributes"]
        self._put(path, "Mesh", geometry, "MeshPhongMaterial", rgba, shading | {"vertexColors": has_colors}, image)

    def line(self, path: str, points: np.ndarray, rgba: Rgba, kind: str = "Line") -> None:
        """Add a line through points (k, 3) to a node; with kind "LineSegments" each pair of points is a line."""
        geometry = _geometry({"position": _attribute(points.astype(np.float32))})
        self._put(path, kind, geometry, "LineBasicMaterial", rgba, {"linewidth": 2, "vertexColors": False})

    def place(self, path: str, matrix: np.ndarray) -> None:
        """Set the placement of a node in its parent, (4, 4)."""
        self._commands.append({"type": "set_transform", "path": path, "matrix": matrix.T.ravel().tolist()})

    def hide(self, path: str) -> None:
        """Hide a node."""
        self._commands.append({"type": "set_property", "path": path, "property": "visible", "value": False})

    def move(self, path: str, **tracks: tuple[np.ndarray, np.ndarray]) -> None:
        """Animate a node: times (k,) and values of its position, quaternion (x, y, z, w), scale or visibility."""
        self._tracks[path] = [
            {
                "name": f".{name}",
                "type": _KINDS[name],
                "times": t.astype(np.float32),
                "values": values.tolist() if name == "visible" else values.astype(np.float32).ravel(),
            }
            for name, (t, values) in tracks.items()
        ]

    def _put(
        self, path: str, kind: str, geometry: Command, shader: str, rgba: Rgba, shading: Command,
        image: bytes | None = None,
    ) -> None:  # fmt: skip
        red, green, blue = (round(255 * min(max(part, 0.0), 1.0)) for part in rgba[:3])
        look: Command = {"type": shader, "color": red << 16 | green << 8 | blue} | shading
        if rgba[3] < 1:
            look |= {"transparent": True, "opacity": rgba[3], "depthWrite": False}
        material = {"uuid": _name(json.dumps(look))} | look
        object_: Command = {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [geometry],
            "materials": [material],
            "object": {"uuid": _name(path), "type": kind, "geometry": geometry["uuid"], "material": material["uuid"]},
        }
        if image is not None:
            picture = {"uuid": _name(image), "url": "data:image/png;base64," + base64.b64encode(image).decode()}
            texture = {"uuid": _name(picture["uuid"]), "image": picture["uuid"], "wrap": [1000, 1000], "repeat": [1, 1]}
            object_ |= {"images": [picture], "textures": [texture]}
            material["map"] = texture["uuid"]
        self._commands.append({"type": "set_object", "path": path, "object": object_})


def triangles(mesh: Mesh) -> Command:
    """Return the geometry of a mesh; its normals have 7 bits, which are enough for shading."""
    index = mesh.faces.ravel().astype(np.uint16 if len(mesh.vertices) <= 2**16 else np.uint32)
    attributes = {
        "position": _attribute(mesh.vertices.astype(np.float32)),
        "normal": _attribute(np.round(127 * mesh.normals).astype(np.int8), normalized=True),
    }
    if mesh.uv is not None:
        attributes["uv"] = _attribute(mesh.uv.astype(np.float32))
    if mesh.colors is not None:
        attributes["color"] = _attribute(mesh.colors.astype(np.uint8), normalized=True)
    return _geometry(attributes, index={"type": _array_type(index), "array": index})


def as_text(document: Any) -> str:
    """Return a document that contains arrays as text for the page's script: length, JSON and arrays, then `packed`.

    For better compression, an array is stored byte by byte: the first bytes of all numbers, then the second, and so on.
    """
    arrays: dict[str, tuple[int, bytes]] = {}
    end = 0

    def place(array: Any) -> Any:
        nonlocal end
        if not isinstance(array, np.ndarray):
            raise TypeError(f"{type(array)} cannot be written")
        numbers = array.tobytes()
        name = _name(array.dtype.name, numbers)
        if name not in arrays:
            arrays[name] = end, np.frombuffer(numbers, np.uint8).reshape(-1, array.itemsize).T.tobytes()
            end += array.nbytes
        return {"$array": _array_type(array), "offset": arrays[name][0], "length": array.size}

    head = json.dumps(document, default=place, allow_nan=False).encode()
    return packed(b"".join([len(head).to_bytes(8, "little"), head, *(planes for _, planes in arrays.values())]))


def packed(content: bytes) -> str:
    """Return compressed bytes as base64 of gzip, without characters that are special in HTML."""
    return base64.b64encode(gzip.compress(content, compresslevel=6, mtime=0)).decode()


def _geometry(attributes: Command, **index: Command) -> Command:
    name = _name(*(entry["array"].tobytes() for entry in (*attributes.values(), *index.values())))
    return {"uuid": name, "type": "BufferGeometry", "data": {"attributes": attributes} | index}


def _attribute(array: np.ndarray, normalized: bool = False) -> Command:
    flat = np.ascontiguousarray(array).ravel()
    return {"itemSize": array.shape[1], "type": _array_type(flat), "array": flat, "normalized": normalized}


def _array_type(array: np.ndarray) -> str:
    return f"{array.dtype.name.capitalize()}Array"


def _name(*contents: str | bytes) -> str:
    """Return a name that is equal for equal contents, so that equal runs give equal pages."""
    digest = hashlib.sha256()
    for content in contents:
        digest.update(content.encode() if isinstance(content, str) else content)
    return digest.hexdigest()[:32]
