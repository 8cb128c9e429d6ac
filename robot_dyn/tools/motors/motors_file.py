"""Motors of joints from a CSV file: peak and continuous torque, speed, gear and rotor.

    joint, peak [N m], continuous [N m], speed [rad/s], gear_ratio, rotor_inertia [kg m^2], at
    shoulder_pan_joint, 150, 56, 3.15, 101, 1.2e-4, joint

Torques and speeds are at the joint, or at the motor shaft if the column `at` is "motor": the gear ratio then multiplies
the torque and divides the speed. A rotor adds the inertia ratio² · rotor_inertia at the joint.
[Siciliano et al. 2009, sec. 5.2]
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, pi
from pathlib import Path
from typing import Any, final

from robot_dyn.foundations import PlanError, csv_rows, nearest, shorten

_MOST_BYTES = 2**20
_HEAD = re.compile(r"\s*([a-z_ ]+?)\s*(?:\[(.*?)\])?\s*")
# units of columns with their factors, including units of prismatic joints
_TORQUE = {"N m": 1.0, "Nm": 1.0, "N": 1.0}
_SPEED = {"rad/s": 1.0, "m/s": 1.0, "rpm": pi / 30, "deg/s": pi / 180}
_INERTIA = {"kg m^2": 1.0, "kg m²": 1.0, "kg": 1.0, "kg cm^2": 1e-4, "kg cm²": 1e-4, "g cm^2": 1e-7, "g cm²": 1e-7}
_UNITS: Mapping[str, Mapping[str, float]] = {
    "joint": {"": 1.0},
    "at": {"": 1.0},
    "peak": _TORQUE,
    "continuous": _TORQUE,
    "speed": _SPEED,
    "gear_ratio": {"": 1.0},
    "rotor_inertia": _INERTIA,
}


@final
@dataclass(frozen=True, eq=False)
class Motors:
    """Motors by joint, with values at the joint; joints without a value have no limit, or no rotor inertia.

    Attributes:
        peak: Peak torque, in [N m] or [N].
        continuous: Continuous torque, in [N m] or [N].
        speed: Largest speed, in [rad/s] or [m/s].
        armature: Inertia of the rotor at the joint, in [kg m²] or [kg].
        source: Path of the file.
    """

    peak: Mapping[str, float]
    continuous: Mapping[str, float]
    speed: Mapping[str, float]
    armature: Mapping[str, float]
    source: str = field(default="motors")


def read_motors(path: str | Path) -> Motors:
    """Read the motors of a CSV file; the first line names the columns, with units in brackets.

    Columns: joint, peak [N m], continuous [N m], speed [rad/s], gear_ratio, rotor_inertia [kg m^2], at. All except
    `joint` and `peak` are optional, and entries may be empty. Prismatic joints have [N] and [m/s]; speeds may be in
    [rpm] or [deg/s]. `at` is "joint" or "motor", the place of torques and speeds; it is required with gear ratios.

    Raises:
        PlanError: If the file cannot be read, a column or unit is unknown, or an entry is not a positive number.
    """
    lines = csv_rows(path, _MOST_BYTES, PlanError, "give a CSV file with columns joint, peak [N m] …", skip_blank=True)
    heads = _heads(path, next(lines)[1])
    rows = [_row(where, heads, line) for where, line in lines]
    if not rows:
        raise PlanError(f"{path}: contains no motors; add a line for each joint")
    names = [row["joint"] for row in rows]
    if twice := next((name for k, name in enumerate(names) if name in names[:k]), None):
        raise PlanError(f"{path}: joint {shorten(twice)!r} appears twice; keep one line")
    columns = {
        key: {row["joint"]: row[key] for row in rows if row.get(key)}
        for key in ("peak", "continuous", "speed", "armature")
    }
    return Motors(**columns, source=str(path))


def _heads(path: str | Path, heads: Sequence[str]) -> dict[str, float]:
    """Return the factor of each column, by name."""
    factors: dict[str, float] = {}
    for head in heads:
        match = _HEAD.fullmatch(head)
        name, unit = (match[1].replace(" ", "_"), match[2] or "") if match else (head, "")
        if name not in _UNITS or name in factors:
            raise PlanError(f"{path}: column {shorten(head)!r} is unknown or repeated; {nearest(name, _UNITS)}")
        if unit not in _UNITS[name]:
            listed = "' or '".join(f"{name} [{valid}]" if valid else name for valid in _UNITS[name])
            raise PlanError(f"{path}: column {shorten(head)!r} has no valid unit: write '{listed}'")
        factors[name] = _UNITS[name][unit]
    for needed in ("joint", "peak", *(("at",) if "gear_ratio" in factors else ())):
        if needed not in factors:
            why = " (joint or motor: the place of torques and speeds)" if needed == "at" else ""
            raise PlanError(f"{path}: there is no column {needed!r}{why}; name the columns in the first line")
    return factors


def _row(where: str, factors: Mapping[str, float], line: Sequence[str]) -> dict[str, Any]:
    """Return torques and speed at the joint, and the inertia of the rotor there."""
    texts = {name: text.strip() for name, text in zip(factors, line, strict=True)}
    row: dict[str, Any] = {"joint": texts.pop("joint")}
    at = texts.pop("at", "") or "joint"
    if at not in ("joint", "motor"):
        raise PlanError(f"{where}: at must be joint or motor, got {shorten(at)!r}")
    for name, text in texts.items():
        if text:
            row[name] = factors[name] * _positive(f"{where}: {name}", text)
    if "gear_ratio" not in row and (at == "motor" or "rotor_inertia" in row):
        subject = "values at the motor need" if at == "motor" else "a rotor_inertia needs"
        raise PlanError(f"{where}: {subject} a gear_ratio; give 1 without a gear")
    ratio = row.get("gear_ratio", 1.0)
    for name, power in (("peak", 1), ("continuous", 1), ("speed", -1)):
        if at == "motor" and name in row:
            row[name] *= ratio**power
    return row | {"armature": ratio**2 * row.get("rotor_inertia", 0.0)}


def _positive(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value < inf:
        raise PlanError(f"{name} must be a positive number, got {shorten(text)!r}")
    return value
