"""Origins and centres of mass out of proportion to the robot, most often because they are in millimetres.

    |xyz| > 100 times the median distance between a moving joint and its parent link

In an arm with at least 3 moving joints, so is a centre of mass farther away than twice the longest of these distances
and 0.3 m, the length of a tool. It is an error if a moving joint carries its mass, because M is then wrong by a factor;
all else is a warning.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot
from typing import Any

import numpy as np

from robot_dyn.description import BEYOND, GIMBAL, SEVERAL, TOOL
from robot_dyn.tools.doctor.document import Document, parsed
from robot_dyn.tools.doctor.finding import Finding, Severity
from robot_dyn.tools.doctor.kinds import FindingKind

_FAR = 100.0
_MOVING = ("revolute", "continuous", "prismatic")


def far_origins(document: Document) -> Iterator[Finding]:
    """Report origins of joints and inertials that are far beyond the lengths of the robot."""
    joints = [(joint, joint.find("origin")) for joint in document.root.iterfind("joint")]
    lengths = [(joint, origin, _length(origin)) for joint, origin in joints if origin is not None]
    typical = [length for joint, _, length in lengths if joint.get("type") in _MOVING and length > 0]
    if not typical:
        return
    median = float(np.median(typical))
    for _, origin, length in lengths:
        if length > _FAR * median:
            yield _finding(document, origin, length, median)
    longest = max((length for *_, length in lengths if length <= _FAR * median), default=median)
    most = min(_FAR * median, max(BEYOND * longest, TOOL)) if len(typical) >= SEVERAL else _FAR * median
    for inertial in document.root.iterfind("link/inertial"):
        if (origin := inertial.find("origin")) is not None:
            length = _length(origin)
            if length > most:
                counts = longest >= GIMBAL and parsed(_mass(inertial)) > 0 and _moves(document, inertial.getparent())
                yield _finding(document, origin, length, median, Severity.ERROR if counts else Severity.WARNING)


def _mass(inertial: Any) -> str | None:
    mass = inertial.find("mass")
    return None if mass is None else mass.get("value")


def _moves(document: Document, link: Any) -> bool:
    """Return True if a moving joint carries a link."""
    joints = document.root.iterfind("joint[child]")
    above = {(joint.find("child").get("link") or "").strip(): joint for joint in joints}
    name, seen = (link.get("name") or "").strip(), set[str]()
    while name in above and name not in seen:
        seen.add(name)
        joint = above[name]
        if joint.get("type") in _MOVING:
            return True
        parent = joint.find("parent")
        name = "" if parent is None else (parent.get("link") or "").strip()
    return False


def _length(origin: Any) -> float:
    """Return |xyz| in [m]; 0 if it is not three numbers."""
    values = [parsed(word) for word in (origin.get("xyz") or "").split()]
    length = hypot(*values) if len(values) == 3 else 0.0
    return length if np.isfinite(length) else 0.0


def _finding(
    document: Document, origin: Any, length: float, median: float, severity: Severity = Severity.WARNING
) -> Finding:
    quantity = "centre of mass" if origin.getparent().tag == "inertial" else "origin"
    return document.finding(
        severity, FindingKind.ORIGIN_FAR, origin,
        f'its {quantity}, xyz "{" ".join(origin.get("xyz").split())}", is {length:.3g} m away, but the median link'
        f" length of this robot is {median:.3g} m",
        "correct it, or convert it to metres",
    )  # fmt: skip
