"""Missing joint axes: a moving joint without one turns about x, the default of URDF, which is rarely intended."""

from __future__ import annotations

from collections.abc import Iterator

from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.finding import Finding, Severity
from robot_dyn.tools.doctor.kinds import FindingKind


def missing_axes(document: Document) -> Iterator[Finding]:
    """Report moving joints without an <axis>."""
    for joint in document.root.iterfind("joint"):
        axis = joint.find("axis")
        if joint.get("type") in ("revolute", "continuous", "prismatic") and (axis is None or axis.get("xyz") is None):
            yield document.finding(
                Severity.WARNING, FindingKind.AXIS_MISSING, joint,
                f'is {joint.get("type")} but has no <axis>; xyz="1 0 0" is used',
                'write the axis, <axis xyz="0 0 1"/>, even where it is x',
            )  # fmt: skip
