"""Boxes, cylinders and spheres of a URDF as bodies of density 1, in closed form: the solid and its shell.

A shell is the surface at 1 kg/m², the limit of a wall whose thickness goes to 0. Both have their centre of mass at the
origin and their principal axes along x, y, z. [Solids: `robot_dyn.description.solids`]
"""

from __future__ import annotations

from math import pi

import numpy as np

from robot_dyn.description import solids
from robot_dyn.description.inertia import MassProperties


def solid(kind: str, lengths: tuple[float, ...]) -> MassProperties:
    """Return a box (x, y, z), cylinder (radius, length) or sphere (radius,) at 1 kg/m³; lengths in [m]."""
    if kind == "box":
        return solids.box(float(np.prod(lengths)), *lengths)
    if kind == "cylinder":
        radius, length = lengths
        return solids.cylinder(pi * radius**2 * length, radius, length)
    (radius,) = lengths
    return solids.sphere(4 / 3 * pi * radius**3, radius)


def shell(kind: str, lengths: tuple[float, ...]) -> MassProperties:
    """Return the surface of a box, cylinder (with its ends) or sphere at 1 kg/m²; lengths in [m], see `solid`."""
    if kind == "box":
        return _box(*lengths)
    if kind == "cylinder":
        return _cylinder(*lengths)
    (radius,) = lengths
    mass = 4 * pi * radius**2
    return _principal(mass, np.full(3, 2 / 3 * mass * radius**2))


def _box(x: float, y: float, z: float) -> MassProperties:
    """Return three pairs of rectangles: ∫ u² dA is l²/12 A in the plane, and l²/4 A for the pair at ± l/2."""
    squares, areas = np.array([x, y, z]) ** 2, 2 * np.array([y * z, z * x, x * y])
    second = squares * (areas.sum() - areas) / 12 + squares * areas / 4  # ∫ x² dA, ∫ y² dA, ∫ z² dA
    return _principal(areas.sum(), second.sum() - second)


def _cylinder(radius: float, length: float) -> MassProperties:
    """Return the wall and two discs at ± length/2."""
    wall, ends = 2 * pi * radius * length, 2 * pi * radius**2
    about_z = wall * radius**2 + ends * radius**2 / 2
    across = about_z / 2 + length**2 * (wall / 12 + ends / 4)
    return _principal(wall + ends, np.array([across, across, about_z]))


def _principal(mass: float, moments: np.ndarray) -> MassProperties:
    return MassProperties(mass, np.zeros(3), np.diag(moments))
