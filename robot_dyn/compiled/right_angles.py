"""Right angles that a file states with too few digits: rpy = 1.57079632679 means π/2, and R gets its exact zeros.

A literal of nine decimals or more within one unit of its last digit of a multiple of π/2 is written out in full. That
turns a frame by less than 1e-9 rad, and halves the kernel. Masses, inertias and translations are never touched.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.model.description import Description
from robot_dyn.model.robot import Robot

_LEAST_DECIMALS = 9  # with fewer, the angle meant is a guess, and the change could be seen in a comparison of roads
_FULL = 15  # decimals: nothing to add


def completed(robot: Robot) -> tuple[Robot, tuple[str, ...]]:
    """The robot with right angles written out in full, and what was changed, in words."""
    root, changes = robot.description.element, []
    for joint in root.iterfind("joint"):
        origin = joint.find("origin")
        if origin is None:
            continue
        words = origin.get("rpy", "").split()
        full = [_completed(word) for word in words]
        if full != words:
            change = max(abs(float(a) - float(b)) for a, b in zip(words, full, strict=True))
            changes.append(
                f"joint {joint.get('name')!r}: rpy {' '.join(words)} taken as right angles ({change:.0e} rad)"
            )
            origin.set("rpy", " ".join(full))
    if not changes:
        return robot, ()
    return Robot(replace(robot.description, xml=etree.tostring(root)), robot.edits), tuple(changes)


def robot_of(dynamics: Any) -> Robot | None:
    """The robot whose equations a dynamics has, its right angles written out in full; None if there is none."""
    robot = getattr(dynamics, "robot", dynamics)
    if not isinstance(getattr(robot, "description", None), Description) or not isinstance(robot, Robot):
        return None
    return completed(robot)[0]


def _completed(literal: str) -> str:
    mantissa, _, exponent = literal.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    if exponent or not _LEAST_DECIMALS <= decimals < _FULL:
        return literal
    angle = float(literal)
    right = round(angle / (math.pi / 2)) * (math.pi / 2)
    return repr(right) if 0 < abs(angle - right) <= 10.0**-decimals else literal
