"""Tables: columns by heading, which is a name with or without a unit, such as "elbow_joint [deg]" or "t (ms)"."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from robot_dyn.foundations.errors import PlanError, shown

_HEADING = re.compile(r"\s*(.*?)\s*(?:\[([^]]*)\]|\(([^)]*)\))?\s*")
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "us": 1e-6, "ns": 1e-9},
    "angle": {"rad": 1.0, "deg": np.pi / 180, "°": np.pi / 180},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
}

TIME_NAMES = "t", "time", "timestamp", "stamp"


class Table(NamedTuple):
    """Columns by heading; for a log also its times, (m,), in [s], and a note on their origin."""

    columns: dict[str, np.ndarray]
    t: np.ndarray | None = None
    note: str = ""


def name_of(heading: str) -> str:
    """Return the heading without its unit."""
    match = _HEADING.fullmatch(heading)
    return match[1] if match else heading


def unit_of(heading: str) -> str | None:
    """Return the unit that a heading states; None if it states none."""
    match = _HEADING.fullmatch(heading)
    return ((match[2] or match[3] or "").strip() or None) if match else None


def is_text(column: np.ndarray) -> bool:
    """Return True for a column without numbers: texts, truth values, stamps, or only gaps."""
    if column.dtype.kind != "O":
        return column.dtype.kind in "bSUTMm" or (column.dtype.kind == "f" and bool(np.isnan(column).all()))
    return not any(
        isinstance(entry, int | float) and not isinstance(entry, bool) and entry == entry for entry in column
    )


def size(heading: str, kind: str, unit: str | None = None) -> tuple[float, bool]:
    """Return the unit of a column in SI units, and True if the heading, or `unit` for angles, states it.

    Raises:
        PlanError: If the unit is unknown, or the heading states a unit other than `unit`.
    """
    stated, units = unit_of(heading), UNITS[kind]
    if stated is None:
        return (units[unit], True) if kind == "angle" and unit else (1.0, kind == "length")
    if stated not in units:
        raise PlanError(f"column {shown(heading)}: the unit must be one of {', '.join(units)}")
    if kind == "angle" and unit and units[unit] != units[stated]:
        raise PlanError(f"column {shown(heading)} states a unit other than unit={unit!r}; remove unit (--unit)")
    return units[stated], True
