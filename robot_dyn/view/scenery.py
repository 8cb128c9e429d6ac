"""The surroundings of the robots of a page: gravity points down, the floor is below, and the camera sees everything.

R g/‖g‖ = −z    the scene is the base rotated by the smallest such R
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any, final

import numpy as np

from robot_dyn.foundations.spatial import homogeneous
from robot_dyn.model.robot import Robot
from robot_dyn.view.commands import Canvas, triangles
from robot_dyn.view.geometry.shapes import arrow

_GROUND = (0.7, 0.73, 0.77, 1.0)
_GRAVITY = (0.42, 0.24, 0.6, 1.0)  # violet
_CORNER = np.array([0.67, -0.67, 0.32])  # default direction of the camera, from the middle of the scene
_POINT = 1e-9  # [m], below which nothing has a size
_FRONTAL = 1.2  # weight of the view from the front for a flat scene
_OUTWARD = np.array([d for d in product(range(-2, 3), repeat=3) if any(d)], dtype=float)  # directions of an outline
_ARROW = 0.3  # length of the arrow of gravity, in radii of the scene
_FLOOR = 1.5  # half the width of the floor, in radii of the scene


@final
@dataclass(frozen=True, eq=False)
class Scenery:
    """The visible scene.

    Attributes:
        center: Centre of a sphere around the scene, (3,), in [m].
        radius: Radius of the sphere, in [m].
        floor: The lowest z, in [m].
        camera: Unit vector from the center to the camera, (3,).
        outline: The outermost points in some directions, (k, 3), all in the view of the camera.
    """

    center: np.ndarray
    radius: float
    floor: float
    camera: np.ndarray
    outline: np.ndarray

    @property
    def square(self) -> float:
        """Edge of the squares on the floor, in [m]."""
        return 10.0 ** np.round(np.log10(self.radius)) / 5

    @property
    def aside(self) -> np.ndarray:
        """Start of the arrow of gravity, at the left of the scene, (3,)."""
        left = np.cross(self.camera, [0.0, 0.0, 1.0])
        length = np.linalg.norm(left)
        left = left / length if length > 1e-6 else np.array([-1.0, 0.0, 0.0])  # seen from above
        away = ((self.outline - self.center) @ left).max() + 0.1 * self.radius
        return self.center + away * left + [0.0, 0.0, _ARROW * self.radius]

    def as_json(self) -> dict[str, Any]:
        """Return data for the camera of the page; the arrow of gravity is in view."""
        seen = np.vstack([self.outline, self.aside, self.aside - [0.0, 0.0, _ARROW * self.radius]])
        places = {"center": self.center, "camera": self.camera, "outline": seen}
        return {"radius": self.radius} | {name: place.tolist() for name, place in places.items()}


def scenery(points: np.ndarray) -> Scenery:
    """Return the scene around points (k, 3); flat scenes are seen more from the front."""
    low, high = points.min(axis=0), points.max(axis=0)
    center = (low + high) / 2
    radius = float(np.linalg.norm(points - center, axis=1).max())
    radius = radius if radius > _POINT else 1e-3
    variances, axes = np.linalg.eigh(np.cov(points.T))
    spread = np.sqrt(np.maximum(variances, 0.0))
    normal = axes[:, 0] * (1.0 if axes[:, 0] @ _CORNER >= 0 else -1.0)
    flat = (spread[1] - spread[0]) / spread[2] if spread[2] > 0 else 0.0
    camera = _CORNER / np.linalg.norm(_CORNER) + _FRONTAL * flat * normal
    outline = points[np.unique((points @ _OUTWARD.T).argmax(axis=0))]
    return Scenery(center, radius, float(low[2]), camera / np.linalg.norm(camera), outline)


def upright(gravity: tuple[float, float, float]) -> np.ndarray:
    """Return the smallest rotation (3, 3) that rotates gravity to −z; the identity without gravity."""
    from scipy.spatial.transform import Rotation

    size = float(np.linalg.norm(gravity))
    if size == 0:
        return np.eye(3)
    return Rotation.align_vectors([[0.0, 0.0, -1.0]], [np.array(gravity) / size])[0].as_matrix()


def surround(canvas: Canvas, seen: Scenery, gravity: tuple[float, float, float]) -> None:
    """Draw squares on the floor and, if there is gravity, an arrow down at the left of the scene."""
    middle, count = np.round(seen.center[:2] / seen.square), int(np.ceil(_FLOOR * seen.radius / seen.square))
    ticks = np.arange(-count, count + 1)
    x, y = np.meshgrid(ticks, ticks[:-1], indexing="ij")  # each edge is a line: viewers drop lines behind the camera
    along = np.stack([np.stack([x, y], axis=-1), np.stack([x, y + 1], axis=-1)], axis=-2).reshape(-1, 2)
    flat = (np.vstack([along, along[:, ::-1]]) + middle) * seen.square
    canvas.line("ground", np.column_stack([flat, np.full(len(flat), seen.floor)]), _GROUND, kind="LineSegments")
    if any(gravity):
        canvas.mesh("gravity", triangles(arrow(_ARROW * seen.radius)), _GRAVITY)
        canvas.place("gravity", homogeneous(np.diag([1.0, -1.0, -1.0]), seen.aside))


def gravity_label(robot: Robot) -> str:
    """Return the label of gravity in the picture."""
    gravity = robot.edits.gravity
    if not any(gravity):
        return "no gravity"
    acts = "" if robot.gravity_acts else ", without torque on any joint"
    return f"↓ gravity {np.linalg.norm(gravity):.4g} m/s²{acts}"


def turned(gravity: tuple[float, float, float]) -> list[str]:
    """Return a note on the orientation of the scene, unless gravity acts along −z of the base."""
    if not any(gravity):
        return ["gravity is zero; up is z of the base"]
    if np.array_equal(upright(gravity), np.eye(3)):
        return []
    return [f"the scene is rotated so that gravity, {gravity} m/s² in base axes, points down"]
