"""SI units of revolute and prismatic joints, and numbers with their units as text."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from robot_dyn.foundations.coefficients import Coefficient, HasJointNames, declared

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


_ROUNDING = 1e-12  # about 10⁴ rounding units 2⁻⁵³, which a sum may leave instead of 0
_NONE = 1e9  # larger limits count as none
_UNITS = {"q": ("rad", "m"), "v": ("rad/s", "m/s"), "a": ("rad/s²", "m/s²"), "tau": ("N m", "N"), "u": ("N m", "N")}


def unit(quantity: str, joint_type: str | None) -> str:
    """Return the unit of "q", "v", "a", "tau" or "u" of a joint; both units if its type is unknown."""
    turns, slides = _UNITS[quantity]
    if joint_type is None:
        return f"{turns} or {slides}"
    return slides if joint_type == "prismatic" else turns


def of_joint(stated: str, joint_type: str | None) -> str:
    """Convert a unit for revolute joints, such as "N m s/rad", to a joint type: "N s/m" for a prismatic one."""
    if joint_type != "prismatic":
        return stated
    return stated.replace("N m", "N").replace("kg m²", "kg").replace("rad", "m")


def coefficient_unit(coefficient: Coefficient, joint_types: Iterable[str | None]) -> str:
    """Return the unit of a coefficient, or both distinct units for revolute and prismatic joints."""
    kinds = joint_types if coefficient.is_per_joint else (None,)
    return " or ".join(dict.fromkeys(of_joint(coefficient.unit, kind) for kind in kinds))


def joint_types_of(dynamics: HasJointNames) -> tuple[str | None, ...]:
    """Return the joint types of the robot of a dynamics object; None for each joint if it has no robot."""
    return getattr(getattr(dynamics, "robot", dynamics), "joint_types", (None,) * len(dynamics.joint_names))


def joint_units(quantity: str, joint_types: Iterable[str | None]) -> str:
    """Return the distinct units of a vector over joints, such as "rad or m"."""
    of_joints = dict.fromkeys(unit(quantity, kind) for kind in joint_types)
    both = unit(quantity, None)
    return both if both in of_joints else " or ".join(of_joints)


def coefficient_texts(part: object, joint_types: Sequence[str | None], signal: str = "signal") -> dict[str, str]:
    """Return the coefficients of a part, by name: symbol, value and unit, for example "b = 0.5 N m s/rad".

    `signal` is the unit of the signal through a block of a digital loop.
    """
    texts = {}
    for name, original in declared(type(part)).items():
        coefficient = replace(original, unit=original.unit.replace("signal", signal))
        values, symbol = getattr(part, name), coefficient.symbol.partition(",")[0] or name
        if values is None or name.startswith("_"):  # internal to a run
            continue
        if coefficient.is_per_joint:
            values = np.broadcast_to(values, len(joint_types))
            original = [_one(x, coefficient, kind) for x, kind in zip(values, joint_types, strict=True)]
            texts[name] = f"{symbol} = {', '.join(original if len(set(original)) > 1 else original[:1])}"
        else:
            shown = f"{values:g}" if np.ndim(values) == 0 else np.array2string(np.asarray(values), precision=6)
            texts[name] = f"{symbol} = {shown} {coefficient.unit}".rstrip()
    return texts


def _one(x: float, coefficient: Coefficient, kind: str | None) -> str:
    """Format a number with its unit; a limit that does not exist is "none"."""
    return "none" if coefficient.infinite and abs(x) >= _NONE else f"{x:g} {of_joint(coefficient.unit, kind)}".rstrip()


def format_duration(seconds: float) -> str:
    """Format a time with two digits and its unit."""
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min"), (1.0, "s"), (1e-3, "ms")):
        if seconds >= size:
            return f"{float(f'{seconds / size:.2g}'):g} {unit}"
    return f"{float(f'{seconds * 1e6:.2g}'):g} µs"


def without_rounding(values: ArrayLike) -> np.ndarray:
    """Return numbers for display, with 0 for −0 and for values below 1e-12 of the array's largest finite one.

    If terms cancel, float64 leaves a meaningless remainder of about 1e-16 of the terms. Files and JSON contain the
    exact numbers.

    Args:
        values: Numbers of one quantity, in one unit of force or motion, any shape.
    """
    values = np.asarray(values, dtype=float)
    sizes = np.abs(values)
    least = _ROUNDING * sizes.max(where=np.isfinite(sizes), initial=0.0)
    return np.where(sizes <= least, 0.0, values)


def numbers_row(numbers: ArrayLike) -> str:
    """Format the numbers of a vector in columns of equal width, with 0 for rounding residues."""
    return " ".join(f"{x:10.5g}" for x in without_rounding(numbers))
