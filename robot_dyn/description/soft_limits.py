"""Soft limits of <safety_controller> as position limits: the interval that both allow, as MoveIt reads them."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isnan

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description.description import Description, check
from robot_dyn.description.edits import Edits
from robot_dyn.description.markup import parse
from robot_dyn.description.other_programs import LOWER, UPPER, statements
from robot_dyn.description.structure import structure_of
from robot_dyn.foundations.errors import EditError


def within_soft_limits(description: Description) -> Description:
    """Return the description with the position limits of each joint narrowed to its soft limits.

    Raises:
        EditError: If the file states no soft limits, or those of a joint are not numbers or leave no position.
    """
    robot, _ = parse(description.text, description.source)
    joints = {
        name: joint
        for name, joint in structure_of(description, Edits()).joints.items()
        if joint.kind in ("revolute", "prismatic")
    }
    soft: dict[str, dict[str, float]] = {}
    for item in statements(robot):
        if item.quantity in (LOWER, UPPER) and item.joint in joints:
            if isnan(item.value):
                raise EditError(f"joint {item.joint!r}: <{item.element}> is not a number; correct it, or remove it")
            soft.setdefault(item.joint, {})[item.quantity] = item.value
    if not soft:
        raise EditError(f"the file of {description.name} states no soft limits; add <safety_controller> to its joints")
    for element in robot.iterfind("joint"):
        if (name := (element.get("name") or "").strip()) in soft:
            joint, low, high = joints[name], soft[name].get(LOWER, -inf), soft[name].get(UPPER, inf)
            assert joint.lower is not None and joint.upper is not None  # a moving joint
            lower, upper = max(joint.lower, low), min(joint.upper, high)
            if not (low <= high and lower <= upper):
                raise EditError(
                    f"joint {name!r}: no position is within its soft limits, {low:g} to {high:g}, and its limits,"
                    f" {joint.lower:g} to {joint.upper:g}; correct soft_lower_limit or soft_upper_limit"
                )
            limit = element.find("limit")
            limit = etree.SubElement(element, "limit") if limit is None else limit
            limit.set("lower", repr(lower))
            limit.set("upper", repr(upper))
    checked = check(etree.tostring(robot, encoding="UTF-8"), description.source)
    return replace(checked, findings=description.findings)
