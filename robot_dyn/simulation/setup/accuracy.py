"""The accuracy that is asked for, as one number for all joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robot_dyn.errors import QueryError, shown
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.validate import number

_UNITS = ("rad", "m")


def asked(given: Any, dynamics: Dynamics) -> float:
    """Of one number, itself; of one for each unit, the least of those that the joints have.

    Raises:
        QueryError: If it is not a positive number, or lacks the unit of a joint.
    """
    if not isinstance(given, Mapping):
        return number("accuracy", given, above=0)
    if unknown := [name for name in given if name not in _UNITS]:
        raise QueryError(f"accuracy: no unit {shown(unknown[0])}; give 'rad', 'm' or both")
    kinds = getattr(getattr(dynamics, "robot", dynamics), "joint_types", None)
    slides = [None] if kinds is None else [kind == "prismatic" for kind in kinds]
    units = [unit for unit, slide in zip(_UNITS, (False, True), strict=True) if slide in slides or None in slides]
    if missing := [unit for unit in units if unit not in given]:
        raise QueryError(f"accuracy: says nothing of joints in {missing[0]}, got {shown(dict(given))}; add it")
    return min(number(f"accuracy in {unit}", given[unit], above=0) for unit in units)
