"""Numbers of the <visual> and <collision> elements of a URDF, which the checked description omits."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]
from numpy import ndarray

from robot_dyn.foundations.errors import shorten
from robot_dyn.foundations.spatial import homogeneous, rotation_rpy
from robot_dyn.shapes.mesh_files import MeshError

SMALLEST, LARGEST = 1e-9, 1e6  # limits of lengths in [m]; LARGEST also of positions
LENGTHS = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
}  # attributes of each shape, with their number of values


def numbers(element: etree._Element, key: str, count: int, default: str = "") -> tuple[float, ...]:
    """Return the numbers of an attribute; raise MeshError unless they are `count` finite numbers."""
    text, values = element.get(key, default), ()
    with suppress(ValueError):
        values = tuple(map(float, text.split()))
    if len(values) != count or not np.all(np.abs(values) <= LARGEST):
        raise MeshError(f"<{element.tag}> {key} must be {count} finite numbers, got {shorten(text)!r}; correct it")
    return values


def pose(element: etree._Element) -> ndarray:
    """Return the placement (4, 4) of a shape in its link, from the first <origin>; raise MeshError if malformed."""
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    rpy, xyz = (np.array(numbers(origin, key, 3, "0 0 0")) for key in ("rpy", "xyz"))
    return homogeneous(rotation_rpy(rpy), xyz)


def shape(element: etree._Element) -> etree._Element:
    """Return the box, cylinder, sphere or mesh of a <visual> or <collision>; raise MeshError if it has none."""
    geometry = element.find("geometry")
    if geometry is None or not len(geometry):
        raise MeshError("<geometry> is empty; add a box, cylinder, sphere or mesh")
    geometric = geometry[0]
    if geometric.tag != "mesh" and geometric.tag not in LENGTHS:
        raise MeshError(f"<{shorten(geometric.tag)}> is not a shape of URDF; give a box, cylinder, sphere or mesh")
    return geometric


def is_empty(primitive: etree._Element) -> bool:
    """Return True if a length of a box, cylinder or sphere is 0; raise MeshError if one is not a number."""
    return 0.0 in _lengths(primitive)


def _lengths(primitive: etree._Element) -> tuple[float, ...]:
    return tuple(x for key, count in LENGTHS[primitive.tag].items() for x in numbers(primitive, key, count))


def lengths(primitive: etree._Element) -> tuple[float, ...]:
    """Return the lengths of a box, cylinder or sphere, in [m]; raise MeshError unless all are positive."""
    values = _lengths(primitive)
    if min(values) < SMALLEST:
        raise MeshError(f"<{primitive.tag}> has a length below {SMALLEST:g} m; correct it")
    return values
