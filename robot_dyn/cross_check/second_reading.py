"""The second reading: a robot's file as read by yourdfpy, compared with the numbers of both implementations.

Pinocchio and the library's own implementation both use the output of the library's URDF reader, so comparing M, C and N
does not reveal an error of that reader. yourdfpy reads the original bytes. The two readings share only the XML parser
(libxml2) and `float`, not the code for elements, attributes, defaults or names.
[URDF: wiki.ros.org/urdf/XML]
"""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO
from typing import Any

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.cross_check.agreement import Pair
from robot_dyn.description.description import Description
from robot_dyn.description.edits import Edits
from robot_dyn.description.urdf import UNBOUNDED
from robot_dyn.foundations.arithmetic import FLOAT64
from robot_dyn.foundations.errors import shorten
from robot_dyn.foundations.spatial import homogeneous, rotation_rpy
from robot_dyn.lagrange.tree import tree_of

_MOMENTS = np.triu_indices(3)  # Ixx, Ixy, Ixz, Iyy, Iyz, Izz
_NONE = float(UNBOUNDED)

Numbers = dict[tuple[str, str], np.ndarray]  # by quantity and element


def second_reading(description: Description, tolerance: float) -> tuple[list[Pair], tuple[str, ...]]:
    """Return the numbers of a description paired with yourdfpy's, and a note if yourdfpy cannot read the file."""
    try:
        robot = _by_yourdfpy(description.text)
        read, elements = dict(_numbers_by_yourdfpy(robot)), set(_elements_by_yourdfpy(robot))
    except Exception as error:  # yourdfpy can raise anything
        message = getattr(
            error, "msg", f"{type(error).__name__}: {error}"
        )  # the message of a syntax error, without its position
        why = shorten(" ".join(str(message).split()), 200)
        return [], (f"no second reading of the file: yourdfpy cannot read it ({why})",)
    used, names = dict(_numbers_of_description(description)), set(_elements_of_description(description))
    pairs = [
        Pair("file: links and joints", float(name in names), float(name in elements), 1.0, tolerance, frame=name)
        for name in sorted(names | elements)
    ]
    for key in sorted(used.keys() | read.keys()):
        one, two = (side.get(key, np.array(np.nan)) for side in (used, read))
        scale = np.ones((4, 4)) if key[0] == "file: origin" else np.maximum(np.abs(one), np.abs(two))
        pairs.append(Pair(key[0], one, two, scale, tolerance, frame=key[1]))
    return pairs, ()


@np.errstate(all="ignore")  # ignores infinities in visuals, which are not compared
def _by_yourdfpy(text: bytes) -> Any:
    from yourdfpy import URDF  # heavy: imports trimesh

    root = etree.fromstring(text)  # raises on errors from which yourdfpy would recover
    if None in root.nsmap:
        raise ValueError("it does not support a default namespace")
    return URDF.load(BytesIO(text), build_scene_graph=False, load_meshes=False).robot


def _elements_by_yourdfpy(robot: Any) -> Iterator[str]:
    """Yield links, including a root that only joints mention, and joints with type and links, as read by yourdfpy."""
    names = {link.name for link in _connected(robot)} | {joint.parent for joint in robot.joints}
    yield from (f"link {name.strip()!r}" for name in names)
    for joint in robot.joints:
        source = joint.mimic.joint.strip() if joint.mimic and joint.type != "fixed" else None
        yield _joint(joint.name.strip(), joint.type, joint.parent.strip(), joint.child.strip(), source)


def _elements_of_description(description: Description) -> Iterator[str]:
    used = tree_of(description, Edits())
    yield from (f"link {link.name!r}" for link in used.links)
    for joint in used.joints:
        yield _joint(joint.name, joint.kind, joint.parent, joint.child, joint.mimic and joint.mimic.source)


def _joint(name: str, kind: str, parent: str, child: str, source: str | None) -> str:
    follows = f", follows {source!r}" if source else ""
    return f"joint {name!r}: {kind}, {parent!r} → {child!r}{follows}"


def _numbers_by_yourdfpy(robot: Any) -> Iterator[tuple[tuple[str, str], np.ndarray]]:
    """Yield the numbers of the file as read by yourdfpy, or the format's defaults if the file states none."""
    for link in _connected(robot):
        where, inertial = f"link {link.name.strip()!r}", link.inertial
        if inertial is not None:
            yield ("file: origin", where), _or_identity(inertial.origin)
            yield ("file: mass", where), np.array(inertial.mass)
            yield ("file: inertia", where), inertial.inertia[_MOMENTS]
    for joint in robot.joints:
        where = f"joint {joint.name.strip()!r}"
        yield ("file: origin", where), _or_identity(joint.origin)
        if joint.type == "fixed":
            continue
        yield ("file: axis", where), joint.axis
        yield ("file: limits", where), _limits(joint)
        if joint.dynamics is not None:
            terms = joint.dynamics.damping, joint.dynamics.friction
            yield ("file: friction", where), np.array([float(term or 0) for term in terms])
        if joint.mimic is not None:
            yield ("file: mimic", where), np.array([joint.mimic.multiplier, joint.mimic.offset])


def _connected(robot: Any) -> list[Any]:
    """Return the links that joints connect, or all links of a robot without joints."""
    connected = {name for joint in robot.joints for name in (joint.parent, joint.child)}
    return [link for link in robot.links if not connected or link.name in connected]


def _or_identity(origin: np.ndarray | None) -> np.ndarray:
    return np.eye(4) if origin is None else origin


def _limits(joint: Any) -> np.ndarray:
    """Return lower, upper, effort and velocity limits; docs/reference/findings.md lists ignored limits."""
    lower, upper, *rates = (
        joint.limit and getattr(joint.limit, key) for key in ("lower", "upper", "effort", "velocity")
    )
    if joint.type == "continuous" or (lower is None and upper is None) or (lower or 0) > (upper or 0):
        lower, upper = -_NONE, _NONE
    return np.array([lower or 0, upper or 0, *(_NONE if x is None or x < 0 else x for x in rates)])


def _numbers_of_description(description: Description) -> Iterator[tuple[tuple[str, str], np.ndarray]]:
    """Yield the same numbers from the description, as both implementations use them."""
    used = tree_of(description, Edits())
    for link in used.links:
        where = f"link {link.name!r}"
        for part in link.inertials:
            yield ("file: origin", where), _placement(part.xyz, part.rpy)
            yield ("file: mass", where), FLOAT64.array(part.mass)
            yield ("file: inertia", where), FLOAT64.array(part.moments)
    elements = {joint.get("name"): joint for joint in description.element.iterfind("joint")}
    for joint in used.joints:
        where, element = f"joint {joint.name!r}", elements[joint.name]
        yield ("file: origin", where), _placement(joint.xyz, joint.rpy)
        if joint.kind == "fixed":
            continue
        yield ("file: axis", where), FLOAT64.array(joint.axis)
        yield ("file: limits", where), _attributes(element.find("limit"), "lower", "upper", "effort", "velocity")
        if (dynamics := element.find("dynamics")) is not None:
            yield ("file: friction", where), _attributes(dynamics, "damping", "friction")
        if joint.mimic is not None:
            yield ("file: mimic", where), FLOAT64.array((joint.mimic.multiplier, joint.mimic.offset))


def _placement(xyz: Any, rpy: Any) -> np.ndarray:
    return homogeneous(rotation_rpy(FLOAT64.array(rpy)), FLOAT64.array(xyz))


def _attributes(element: etree._Element, *keys: str) -> np.ndarray:
    return FLOAT64.array([element.get(key) for key in keys])
