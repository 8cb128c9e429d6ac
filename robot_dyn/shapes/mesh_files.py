"""Bounded reading of mesh files: the files they may open, and checks of their content before a library parses it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path, PureWindowsPath
from stat import S_ISREG
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.foundations.errors import RobotDynError, shorten

if TYPE_CHECKING:
    from trimesh.resolvers import FilePathResolver

MAX_BYTES = 64 * 2**20  # per mesh or texture; the largest in example-robot-data has 28 MiB
MAX_NODES = 20_000  # largest number of nodes of a scene, counting every instance
_SHAPING = {
    "EXT_mesh_gpu_instancing": "instances by EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression": "buffers compressed by EXT_meshopt_compression",
    "KHR_meshopt_compression": "buffers compressed by KHR_meshopt_compression",
}
_FAN = 6  # glTF primitive mode: triangle fan
_UNSEEN = ("library_lights", "library_cameras", "library_animations", "instance_light", "instance_camera")


class MeshError(RobotDynError):
    """A shape or texture cannot be read; the message is the reason, which follows the name of the file or link."""


def bounded(path: Path) -> bytes:
    """Return the bytes of a regular file of at most `MAX_BYTES`; raise MeshError for any other file."""
    try:
        status = path.stat()
        if not S_ISREG(status.st_mode):
            raise MeshError("is not a regular file")
        if status.st_size > MAX_BYTES:
            raise MeshError(f"has {status.st_size / 2**20:.0f} MiB, the limit is {MAX_BYTES >> 20}; simplify it")
        return path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise MeshError(f"cannot be read ({getattr(error, 'strerror', error)})") from None


def beside(folder: Path, missing: list[str], anywhere: bool) -> FilePathResolver:
    """Return a resolver of files named by a mesh: regular files, `MAX_BYTES` in total; others go to `missing`."""
    from trimesh.resolvers import FilePathResolver

    class Beside(FilePathResolver):
        def get(self, name: str) -> bytes:
            try:
                return read_beside(name)
            except MeshError as error:
                missing.append(f"{shorten(PureWindowsPath(name).name)} {error}")  # folders stay private
                raise

    left = MAX_BYTES

    @cache
    def read_beside(name: str) -> bytes:
        nonlocal left
        path = Path(name.strip().removeprefix("file://").replace("\\", "/"))
        if not anywhere:
            path = Path(unquote(name))  # a glTF URI
            if path.is_absolute() or ".." in path.parts or "://" in name:
                raise MeshError("is not in the folder of the mesh or below it; move it there")
        data = bounded(folder / path)
        left -= len(data)
        if left < 0:
            raise MeshError(f"makes the total exceed {MAX_BYTES >> 20} MiB; simplify the mesh")
        return data

    return Beside(str(folder), allow_anywhere=True)


def checked_collada(data: bytes) -> etree._Element:
    """Return the document if it has no DTD and a bounded number of nodes, counting all instances."""
    first, prolog = None, etree.XMLPullParser(events=("start",), resolve_entities=False, no_network=True)
    for start in range(0, len(data), 2**12):
        prolog.feed(data[start : start + 2**12])
        if first := next(iter(prolog.read_events()), None):
            break
    if first and first[1].getroottree().docinfo.internalDTD is not None:
        raise MeshError("declares a document type (<!DOCTYPE …>), through which it can read other files; remove it")
    # geometry exceeds the parser's limits on text; without entities, lifting them is safe
    safe = {"resolve_entities": False, "no_network": True, "remove_comments": True, "remove_pis": True}
    root = etree.fromstring(data, etree.XMLParser(**safe, huge_tree=True))
    for tag in _UNSEEN:  # pycollada rejects a scene with an undefined light
        for element in root.findall(f".//{{*}}{tag}"):
            element.getparent().remove(element)
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


def check_gltf(data: bytes, resolver: FilePathResolver) -> None:
    """Raise MeshError for files that trimesh would silently draw wrongly, and for accessors larger than the file.

    For such accessors trimesh would allocate arrays of zeros.
    """
    binary = data[:4] == b"glTF"
    head = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")] if binary else data)
    addresses = [buffer.get("uri", "") for buffer in head.get("buffers", ())]
    available = len(data) + sum(len(resolver[uri]) for uri in addresses if uri and not uri.startswith("data:"))
    if sum(accessor["count"] for accessor in head.get("accessors", ())) > available:
        raise MeshError("declares more vertices than its size allows; export it again")
    if len(head.get("nodes", ())) > MAX_NODES:
        raise MeshError(f"has more than {MAX_NODES} nodes; simplify it")
    if unread := next(_unread(head), None):
        raise MeshError(f"has {unread}, which are not supported; export it without them")


def _unread(head: Any) -> Iterator[str]:
    """Yield the features of a glTF file that affect its triangles but are ignored by trimesh."""
    yield from (features for name, features in _SHAPING.items() if name in head.get("extensionsUsed", ()))
    accessors, meshes, nodes = (head.get(key, ()) for key in ("accessors", "meshes", "nodes"))
    if any("sparse" in accessor for accessor in accessors):
        yield "sparse accessors"
    if any("skin" in node for node in nodes):
        yield "skins"
    if any(any(item.get("weights", ())) for item in (*meshes, *nodes)):
        yield "weights of morph targets"
    for primitive in (item for mesh in meshes for item in mesh["primitives"]):
        if primitive.get("mode") == _FAN:
            yield "triangle fans"
        if accessors[primitive["attributes"]["POSITION"]].get("normalized"):
            yield "normalized positions"
