"""A still picture of a document's scene at t = 0, drawn without a browser, for viewers that do not show pages.

Triangles and lines are painted from far to near, seen from the camera of the page, without textures.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from functools import reduce
from typing import Any, final

import numpy as np

from robot_dyn.foundations.spatial import homogeneous
from robot_dyn.view.commands import Command

WIDTH, HEIGHT, _FINE = 720, 480, 2  # [pixels], and the factor by which it is drawn larger for smooth edges
_TOP, _BOTTOM = (245, 247, 250), (209, 217, 224)  # colours of the page's background
_HALF = np.tan(np.deg2rad(45.0) / 2)  # half of the height that is seen at a distance of 1, as on the page
_MARGIN = 0.9  # fraction of the picture that the scene fills, same as on the page
_LIGHT = np.array([0.4, -0.5, 0.77])


def picture(document: Mapping[str, Any]) -> bytes:
    """Return the scene of a document at t = 0 as a PNG file of 720 × 480 pixels."""
    from PIL import Image, ImageDraw

    size = WIDTH * _FINE, HEIGHT * _FINE
    fade = np.linspace(_TOP, _BOTTOM, size[1]).astype(np.uint8)
    image = Image.fromarray(np.repeat(fade[:, None], size[0], axis=1))
    brush = ImageDraw.Draw(image, "RGBA")
    shapes = [shape for layer in _layers(document) for shape in layer]
    for _, corners, colour in sorted(shapes, key=lambda shape: -shape[0]):
        if len(corners) == 6:
            brush.polygon(corners, colour)
        else:
            brush.line(corners, colour, width=_FINE)
    stream = io.BytesIO()
    image.resize((WIDTH, HEIGHT), Image.Resampling.BOX).save(stream, "PNG", optimize=True)
    return stream.getvalue()


Shape = tuple[float, list[float], tuple[int, ...]]  # depth, corners in pixels, colour


def _layers(document: Mapping[str, Any]) -> Iterator[Iterator[Shape]]:
    """Yield the shapes of each visible object."""
    tree, camera = _Tree(document["commands"]), _Camera(document["scene"])
    for command in document["commands"]:
        if command["type"] == "set_object" and tree.seen(command["path"]):
            yield _shapes(command["object"], tree.placement(command["path"]), camera)


def _shapes(drawn: Command, placement: np.ndarray, camera: _Camera) -> Iterator[Shape]:
    """Yield the triangles or lines of an object in front of the camera."""
    data, look = drawn["geometries"][0]["data"], drawn["materials"][0]
    points = np.reshape(data["attributes"]["position"]["array"], (-1, 3)) @ placement[:3, :3].T + placement[:3, 3]
    base = np.array([look["color"] >> 16, look["color"] >> 8 & 255, look["color"] & 255])
    opacity = round(255 * look.get("opacity", 1.0))
    kind, count = drawn["object"]["type"], len(points)
    if kind == "Mesh":
        index = data["index"]["array"] if "index" in data else np.arange(count)
        parts = np.reshape(index, (-1, 3))
        shade = _shade(points[parts])
    else:
        first = np.arange(0, count - 1, 2 if kind == "LineSegments" else 1)
        parts, shade = np.stack([first, first + 1], axis=1), np.ones(len(first))
    if look["vertexColors"]:
        base = np.reshape(data["attributes"]["color"]["array"], (-1, 3))[parts[:, 0]]
    colours = np.column_stack([np.minimum(shade[:, None] * base, 255).astype(int), np.full(len(parts), opacity)])
    depth, pixels = camera.project(points)
    before = (depth[parts] > camera.near).all(axis=1)
    corners = pixels[parts[before]].reshape(before.sum(), -1)
    far = depth[parts[before]].mean(axis=1)
    return zip(far.tolist(), corners.tolist(), map(tuple, colours[before].tolist()), strict=True)


def _shade(corners: np.ndarray) -> np.ndarray:
    """Return the brightness (m,) of triangles (m, 3, 3); both sides are lit."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    return 0.45 + 0.55 * np.abs(normals @ _LIGHT) / np.where(length > 0, length, 1.0)


@final
class _Tree:
    """Nodes by path: their placement and visibility at the first keyframe."""

    def __init__(self, commands: list[Command]) -> None:
        self._local: dict[str, np.ndarray] = {}
        self._hidden: set[str] = set()
        for command in commands:
            if command["type"] == "set_transform":
                self._local[command["path"]] = np.reshape(command["matrix"], (4, 4)).T
            elif command["type"] == "set_property" and command["property"] == "visible" and not command["value"]:
                self._hidden.add(command["path"])
            elif command["type"] == "set_animation":
                for part in command["animations"]:
                    self._start(part["path"], {track["name"]: track["values"] for track in part["clip"]["tracks"]})

    def _start(self, path: str, tracks: dict[str, Any]) -> None:
        from scipy.spatial.transform import Rotation

        R, p = np.split(self._local.get(path, np.eye(4))[:3], [3], axis=1)
        if ".quaternion" in tracks:
            R = Rotation.from_quat(tracks[".quaternion"][:4]).as_matrix()
        p = np.asarray(tracks.get(".position", p.ravel())[:3], dtype=float)
        self._local[path] = homogeneous(R * np.asarray(tracks.get(".scale", np.ones(3))[:3]), p)
        if ".visible" in tracks and not tracks[".visible"][0]:
            self._hidden.add(path)

    def seen(self, path: str) -> bool:
        """Return True if neither the node nor a node above it is hidden."""
        return self._hidden.isdisjoint(_above(path))

    def placement(self, path: str) -> np.ndarray:
        """Return the placement (4, 4) of a node in the scene."""
        return reduce(np.matmul, (self._local.get(part, np.eye(4)) for part in _above(path)))


def _above(path: str) -> list[str]:
    """Return the paths of the nodes from the root to this one."""
    parts = path.split("/")
    return ["/".join(parts[: k + 1]) for k in range(len(parts))]


@final
class _Camera:
    """The camera of the page: a point (x, z), right and towards it, is seen if |x − x₀| ≤ tan (D − z)."""

    def __init__(self, scene: dict[str, Any]) -> None:
        back = np.array(scene["camera"])
        side = np.cross([0.0, 0.0, 1.0] if abs(back[2]) < 1 - 1e-9 else [0.0, 1.0, 0.0], back)
        side /= np.linalg.norm(side)
        self._axes = np.array([side, np.cross(back, side), -back])  # right, up, forward
        sides, z = np.array(scene["outline"]) @ self._axes[:2].T, np.array(scene["outline"]) @ back
        tan = _MARGIN * _HALF * np.array([WIDTH / HEIGHT, 1.0])
        most, least = (sides + z[:, None] * tan).max(axis=0), (sides - z[:, None] * tan).min(axis=0)
        away = max(z.max() + scene["radius"] / 10, *((most - least) / (2 * tan)))  # D, the least
        self._eye = (most + least) / 2 @ self._axes[:2] + away * back
        self.near = scene["radius"] / 100

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return depth (k,), in [m], and pixels (k, 2) of points (k, 3)."""
        x, y, depth = self._axes @ (points - self._eye).T
        scale = _FINE * HEIGHT / 2 / _HALF / np.where(depth > 0, depth, np.inf)
        return depth, np.column_stack([_FINE * WIDTH / 2 + scale * x, _FINE * HEIGHT / 2 - scale * y])
