"""Limits of joints: missing, 0, crossed or negative; soft limits crossed, equal, or outside the limits."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import Any

from robot_dyn.tools.doctor.document import Document, parsed
from robot_dyn.tools.doctor.finding import Change, Finding, Severity
from robot_dyn.tools.doctor.kinds import FindingKind
from robot_dyn.tools.doctor.literals import limits_in_degrees

_UNITS = {"effort": "N m or N", "velocity": "rad/s or m/s"}


def limits(document: Document) -> Iterator[Finding]:
    """Report faulty limits of moving joints."""
    for joint in document.root.iterfind("joint"):
        if joint.get("type") in ("revolute", "prismatic", "continuous"):
            yield from _of_joint(document, joint)


def _of_joint(document: Document, joint: Any) -> Iterator[Finding]:
    limit = joint.find("limit")
    if limit is None:
        if joint.get("type") != "continuous":
            yield document.finding(
                Severity.WARNING, FindingKind.LIMIT_MISSING, joint, f"is {joint.get('type')} but has no <limit>",
                "add one: URDF requires it, and other programs refuse the file",
            )  # fmt: skip
        return
    stated = {key: x for key in ("lower", "upper", *_UNITS) if isfinite(x := parsed(limit.get(key)))}
    if missing := [key for key in _UNITS if limit.get(key) is None]:
        yield document.finding(
            Severity.WARNING if "effort" in missing else Severity.NOTE, FindingKind.LIMIT_MISSING, joint,
            f"its <limit> has no {' and no '.join(missing)}",
            "add it: URDF requires both, and other programs refuse the file",
        )  # fmt: skip
    for key, unit in _UNITS.items():
        if stated.get(key) == 0:
            yield document.finding(
                Severity.WARNING, FindingKind.LIMIT_ZERO, joint,
                f'its {key} limit is "{limit.get(key).strip()}", which allows no {key} at all',
                f"give the limit in {unit}",
            )  # fmt: skip
        elif stated.get(key, 0.0) < 0:
            yield document.finding(
                Severity.WARNING, FindingKind.LIMIT_NEGATIVE, joint, f'its {key} limit is "{limit.get(key)}"',
                "remove the sign", (Change(limit, key, limit.get(key).strip().lstrip("-")),),
            )  # fmt: skip
    if joint.get("type") == "continuous" or not {"lower", "upper"} & stated.keys():
        return
    lower, upper = stated.get("lower", 0.0), stated.get("upper", 0.0)
    if lower > upper:
        exchanged = Change(limit, "lower", limit.get("upper", "0")), Change(limit, "upper", limit.get("lower", "0"))
        in_degrees = limits_in_degrees(limit)  # 135 … -95: exchanged, they would still be too large
        yield document.finding(
            Severity.WARNING, FindingKind.LIMITS_CROSSED, joint,
            f'its lower limit "{limit.get("lower", "0")}" is above its upper limit "{limit.get("upper", "0")}"',
            "convert them to radians, then exchange them" if in_degrees else "exchange them",
            () if in_degrees else exchanged,
        )  # fmt: skip
    elif lower == upper:
        yield document.finding(
            Severity.WARNING, FindingKind.LIMITS_EQUAL, joint,
            f'its limits are both "{limit.get("lower", "0")}", so it cannot move',
            "correct them, or make the joint fixed",
        )  # fmt: skip
    elif (soft := joint.find("safety_controller")) is not None:
        low, high = (parsed(soft.get(f"soft_{side}_limit")) for side in ("lower", "upper"))
        if low > high:
            yield document.finding(
                Severity.WARNING, FindingKind.SOFT_LIMITS, joint,
                f"its soft lower limit {low:g} is above its soft upper limit {high:g}", "exchange them",
            )  # fmt: skip
        elif low == high:
            yield document.finding(
                Severity.WARNING, FindingKind.SOFT_LIMITS, joint,
                f"its soft limits are both {low:g}, which leave no motion", "correct them, or remove them",
            )  # fmt: skip
        elif low < lower or high > upper:
            yield document.finding(
                Severity.WARNING, FindingKind.SOFT_LIMITS, joint,
                f"its soft limits {low:g} and {high:g} are not within its limits {lower:g} and {upper:g}",
                "move them inside: a controller slows the joint down there, before it reaches its limits",
            )  # fmt: skip
