"""SI units of joints, revolute and prismatic, and numbers with their units as texts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from robot_dyn.foundations.coefficients import Coefficient, declared

_ROUNDING = 1e-12  # some thousand units of rounding, 2⁻⁵³: what sums of terms of that size may leave of 0
_NONE = 1e9  # a stop farther away does not exist
_UNITS = {"q": ("rad", "m"), "v": ("rad/s", "m/s"), "a": ("rad/s²", "m/s²"), "tau": ("N m", "N"), "u": ("N m", "N")}


def unit(quantity: str, joint_type: str | None) -> str:
    """The unit of "q", "v", "a", "tau" or "u" of a joint; both where its type is not known."""
    turns, slides = _UNITS[quantity]
    if joint_type is None:
        return f"{turns} or {slides}"
    return slides if joint_type == "prismatic" else turns


def of_joint(stated: str, joint_type: str | None) -> str:
    """A unit that is stated of a revolute joint, such as "N m s/rad", for a joint of a type: "N s/m" if it slides."""
    if joint_type != "prismatic":
        return stated
    return stated.replace("N m", "N").replace("kg m²", "kg").replace("rad", "m")


def coefficient_unit(known: Coefficient, joint_types: Iterable[str | None]) -> str:
    """The unit of a coefficient, each once where joints turn and slide."""
    kinds = joint_types if known.of_joints else (None,)
    return " or ".join(dict.fromkeys(of_joint(known.unit, each) for each in kinds))


def joint_types_of(dynamics: Any) -> tuple[str | None, ...]:
    """Those of the robot that a dynamics is of; None of each where it has none."""
    return getattr(getattr(dynamics, "robot", dynamics), "joint_types", (None,) * dynamics.n)


def joint_units(quantity: str, joint_types: Iterable[str | None]) -> str:
    """The units of a vector over joints, such as "rad or m": each once."""
    of_joints = dict.fromkeys(unit(quantity, each) for each in joint_types)
    both = unit(quantity, None)
    return both if both in of_joints else " or ".join(of_joints)


def coefficient_texts(part: Any, joint_types: Sequence[str | None], signal: str = "signal") -> dict[str, str]:
    """The coefficients of a part on joints of some types, by name: symbol, value and unit, as "b = 0.5 N m s/rad".

    `signal` is the unit of what goes through a block of a digital loop.
    """
    texts = {}
    for name, stated in declared(type(part)).items():
        each = replace(stated, unit=stated.unit.replace("signal", signal))
        values, symbol = getattr(part, name), each.symbol.partition(",")[0] or name
        if values is None or name.startswith("_"):  # internal to a run
            continue
        if each.of_joints:
            values = np.broadcast_to(values, len(joint_types))
            stated = [_one(x, each, kind) for x, kind in zip(values, joint_types, strict=True)]
            texts[name] = f"{symbol} = {', '.join(stated if len(set(stated)) > 1 else stated[:1])}"
        else:
            shown = f"{values:g}" if np.ndim(values) == 0 else np.array2string(np.asarray(values), precision=6)
            texts[name] = f"{symbol} = {shown} {each.unit}".rstrip()
    return texts


def _one(x: float, known: Coefficient, kind: str | None) -> str:
    """A number and its unit; for a limit that does not exist, "none"."""
    return "none" if known.infinite and abs(x) >= _NONE else f"{x:g} {of_joint(known.unit, kind)}".rstrip()


def format_duration(seconds: float) -> str:
    """A time in two digits, with its unit."""
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min"), (1.0, "s"), (1e-3, "ms")):
        if seconds >= size:
            return f"{float(f'{seconds / size:.2g}'):g} {unit}"
    return f"{float(f'{seconds * 1e6:.2g}'):g} µs"


def without_rounding(values: Any) -> np.ndarray:
    """Numbers as they are shown: 0 in place of −0, and of what is below 1e-12 of the largest finite one of the array.

    Where terms cancel, float64 leaves some units of 1e-16 of the terms; such a rest says nothing. Files and JSON hold
    the numbers as they are.

    Args:
        values: Of one quantity, in one unit of force or motion, any shape.
    """
    values = np.asarray(values, dtype=float)
    sizes = np.abs(values)
    least = _ROUNDING * sizes.max(where=np.isfinite(sizes), initial=0.0)
    return np.where(sizes <= least, 0.0, values)


def numbers_row(numbers: Any) -> str:
    """The numbers of a vector in columns of equal width, 0 for what rounding leaves of it."""
    return " ".join(f"{x:10.5g}" for x in without_rounding(numbers))
