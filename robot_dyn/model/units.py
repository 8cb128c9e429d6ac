"""SI units of positions, velocities, accelerations and torques of joints: revolute ones turn, prismatic ones slide."""

from __future__ import annotations

from collections.abc import Iterable

_UNITS = {"q": ("rad", "m"), "v": ("rad/s", "m/s"), "a": ("rad/s²", "m/s²"), "tau": ("N m", "N"), "u": ("N m", "N")}


def unit(quantity: str, joint_type: str | None) -> str:
    """The unit of "q", "v", "a", "tau" or "u" of a joint; both where its type is not known."""
    turns, slides = _UNITS[quantity]
    if joint_type is None:
        return f"{turns} or {slides}"
    return slides if joint_type == "prismatic" else turns


def units(quantity: str, joint_types: Iterable[str | None]) -> str:
    """The units of a vector over joints, such as "rad or m": each once."""
    of_joints = dict.fromkeys(unit(quantity, each) for each in joint_types)
    both = unit(quantity, None)
    return both if both in of_joints else " or ".join(of_joints)
