"""Commands of meshcat's viewer as values, with NumPy arrays in them, and the two ways they reach a page.

A command travels as MessagePack over a web socket, or with all others in one compressed text inside the page, in which
an array that occurs in several commands is stored once. Objects follow three.js's JSON format 4.5.
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

_EXTENSION = {"int8": 0x11, "uint8": 0x12, "uint16": 0x14, "uint32": 0x16, "float32": 0x17, "float64": 0x18}
_DOUBLE_SIDE = 2  # meshes of real robots have triangles that face the wrong way


def set_transform(path: str, matrix: np.ndarray) -> Command:
    """Place a node in its parent, by a matrix (4, 4)."""
    return {"type": "set_transform", "path": path, "matrix": matrix.T.ravel().tolist()}


def set_property(path: str, name: str, value: Any) -> Command:
    """Set a property of a node."""
    return {"type": "set_property", "path": path, "property": name, "value": value}


def set_object(path: str, geometry: Command, material: Command, kind: str = "Mesh") -> Command:
    """Put a geometry with a material at a node; its `image`, if it has one, is a PNG file."""
    material = dict(material)
    image = material.pop("image", None)
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
    return {"type": "set_object", "path": path, "object": object_}


def set_animation(tracks: dict[str, list[Command]]) -> Command:
    """Animate nodes, by path; it stands at its beginning until the page moves it."""
    clips = [{"path": path, "clip": {"name": path, "fps": 1, "tracks": each}} for path, each in tracks.items()]
    return {"type": "set_animation", "animations": clips, "options": {"play": True, "repetitions": 1}, "path": "replay"}


def track(name: str, kind: str, t: np.ndarray, values: np.ndarray) -> Command:
    """A property of a node at times t (k,): "vector", "quaternion" (x, y, z, w) or "bool"."""
    numbers = values.tolist() if kind == "bool" else values.astype(np.float32).ravel()
    return {"name": f".{name}", "type": kind, "times": t.astype(np.float32), "values": numbers}


def triangles(mesh: Mesh) -> Command:
    """The geometry of a mesh; normals with 7 bits, which are enough for shading."""
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


def polyline(points: np.ndarray) -> Command:
    """The geometry of a line through points (k, 3)."""
    return _geometry({"position": _attribute(points.astype(np.float32))})


def material(rgba: tuple[float, ...], *, line: bool = False, vertex_colors: bool = False) -> Command:
    """A colour, in parts of 1; transparent where its last part is below 1."""
    red, green, blue = (round(255 * min(max(part, 0.0), 1.0)) for part in rgba[:3])
    clear = {} if rgba[3] >= 1 else {"transparent": True, "opacity": rgba[3], "depthWrite": False}
    shading = {"linewidth": 2} if line else {"side": _DOUBLE_SIDE, "shininess": 30, "specular": 0x222222}
    look = {
        "type": "LineBasicMaterial" if line else "MeshPhongMaterial",
        "color": red << 16 | green << 8 | blue,
        "vertexColors": vertex_colors,
    } | (shading | clear)
    return {"uuid": _name(json.dumps(look))} | look


def as_message(command: Command) -> bytes:
    """A command for meshcat's web socket."""
    import umsgpack

    def extension(array: np.ndarray) -> Any:
        return umsgpack.Ext(_EXTENSION[array.dtype.name], array.tobytes())

    return umsgpack.packb(command, ext_handlers={np.ndarray: extension})


def as_text(document: Any) -> str:
    """A document with arrays in it: length, JSON, arrays as `packed`; the page's script reads it.

    Of each array the first bytes of all numbers come first, then the second ones and so on: this compresses better.
    """
    arrays: dict[str, tuple[int, bytes]] = {}
    end = 0

    def place(array: Any) -> Any:
        nonlocal end
        if not isinstance(array, np.ndarray):
            raise TypeError(f"cannot be written: {type(array)}")
        numbers = array.tobytes()
        name = _name(array.dtype.name, numbers)
        if name not in arrays:
            arrays[name] = end, np.frombuffer(numbers, np.uint8).reshape(-1, array.itemsize).T.tobytes()
            end += array.nbytes
        return {"$array": _array_type(array), "offset": arrays[name][0], "length": array.size}

    head = json.dumps(document, default=place, allow_nan=False).encode()
    return packed(b"".join([len(head).to_bytes(8, "little"), head, *(planes for _, planes in arrays.values())]))


def packed(content: bytes) -> str:
    """Bytes, compressed: base64 of gzip, without a character that HTML would read."""
    return base64.b64encode(gzip.compress(content, compresslevel=6, mtime=0)).decode()


def _geometry(attributes: Command, **index: Command) -> Command:
    name = _name(*(each["array"].tobytes() for each in (*attributes.values(), *index.values())))
    return {"uuid": name, "type": "BufferGeometry", "data": {"attributes": attributes} | index}


def _attribute(array: np.ndarray, normalized: bool = False) -> Command:
    flat = np.ascontiguousarray(array).ravel()
    return {"itemSize": array.shape[1], "type": _array_type(flat), "array": flat, "normalized": normalized}


def _array_type(array: np.ndarray) -> str:
    return f"{array.dtype.name.capitalize()}Array"


def _name(*contents: str | bytes) -> str:
    """A name that is equal for equal contents, so that equal runs give equal pages."""
    digest = hashlib.sha256()
    for content in contents:
        digest.update(content.encode() if isinstance(content, str) else content)
    return digest.hexdigest()[:32]
