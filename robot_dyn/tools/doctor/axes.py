"""Axes of joints: one that moves and states none turns about x, the default of URDF, which is hardly ever meant."""

from __future__ import annotations

from collections.abc import Iterator

from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.finding import Finding, Severity


def missing_axes(document: Document) -> Iterator[Finding]:
    """Joints that move and have no <axis>."""
    for joint in document.root.iterfind("joint"):
        axis = joint.find("axis")
        if joint.get("type") in ("revolute", "continuous", "prismatic") and (axis is None or axis.get("xyz") is None):
            yield document.finding(
                Severity.WARNING, "axis_missing", joint,
                f'is {joint.get("type")} and has no <axis>: it is taken as xyz="1 0 0"',
                'write the axis, <axis xyz="0 0 1"/>, even where it is x',
            )  # fmt: skip
