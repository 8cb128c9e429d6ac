"""Unknown elements and attributes with a name close to one of URDF, which other programs ignore.

<orgin xyz="0 0 0.1"/>, <inertia xx="…"/>
"""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches
from typing import Any

from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.finding import Change, Finding, Severity
from robot_dyn.tools.doctor.kinds import FindingKind

_SHAPES = {"box": {"size"}, "cylinder": {"radius", "length"}, "sphere": {"radius"}, "mesh": {"filename", "scale"}}
CHILDREN: dict[str, set[str]] = {  # children in URDF, with extensions of ROS, Gazebo and Drake
    "link": {"inertial", "visual", "collision", "self_collision_checking", "contact", "verbose"},
    "joint": {"origin", "parent", "child", "axis", "calibration", "dynamics", "limit", "mimic", "safety_controller"},
    "inertial": {"origin", "mass", "inertia"},
    "visual": {"origin", "geometry", "material"},
    "collision": {"origin", "geometry", "material", "verbose"},
    "geometry": {*_SHAPES, "capsule"},
}
ATTRIBUTES: dict[str, set[str]] = {
    "link": {"name", "type"},
    "joint": {"name", "type"},
    "origin": {"xyz", "rpy"},
    "mass": {"value"},
    "inertia": {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"},
    "parent": {"link"},
    "child": {"link"},
    "axis": {"xyz"},
    "limit": {"lower", "upper", "effort", "velocity", "acceleration"},
    "dynamics": {"damping", "friction"},
    "mimic": {"joint", "multiplier", "offset"},
    **_SHAPES,
}
_NEEDED = {"mass": {"value"}, "inertia": ATTRIBUTES["inertia"], "parent": {"link"}, "child": {"link"}}
_MATTER = {  # for dynamics: misspelling one of these changes the robot
    "inertial", "origin", "mass", "inertia", "parent", "child", "axis", "dynamics", "limit", "mimic",
}  # fmt: skip
_NEAR = 0.75


def misspelt(document: Document) -> Iterator[Finding]:
    """Report elements and attributes with a name that URDF does not have."""
    for element in document.elements():
        tag, above = element.tag, element.getparent().tag
        allowed_children = CHILDREN.get(above, set())
        if above in CHILDREN and tag not in allowed_children and "}" not in tag and ":" not in tag:
            free = [name for name in allowed_children & _MATTER if element.getparent().find(name) is None]
            yield _finding(document, element, f"<{tag}>", get_close_matches(tag.lower(), free, 1, _NEAR), "")
        for key in (*element.attrib,):
            if (allowed := ATTRIBUTES.get(tag)) and key not in allowed and "}" not in key:
                missing = allowed - {*element.attrib}
                near = get_close_matches(key.lower(), missing, 1, _NEAR) or _only(tag, missing)
                yield _finding(document, element, f"{key} of <{tag}>", near, key)


def _only(tag: str, missing: set[str]) -> list[str]:
    """Return the required attribute of an element, if exactly one is missing."""
    needed = list(_NEEDED.get(tag, set()) & missing)
    return needed if len(needed) == 1 else []


def _finding(document: Document, element: Any, item: str, near: list[str], key: str) -> Finding:
    kind = FindingKind.UNKNOWN_ATTRIBUTE if key else FindingKind.UNKNOWN_ELEMENT
    problem = f"{item} is unknown in URDF and is ignored"
    if not near:
        return document.finding(Severity.NOTE, kind, element, problem, "remove it, or use the name in URDF")
    change = Change(element, near[0], "", key) if key else Change(element, "", near[0])
    meant = near[0] if key else f"<{near[0]}>"
    grave = near[0] == "inertial" or (near[0] not in ("limit", "dynamics") and document.moves_mass(element))
    return document.finding(
        Severity.ERROR if grave else Severity.WARNING,
        kind,
        element,
        problem,
        f"{meant} is meant; correct it",
        (change,),
    )
