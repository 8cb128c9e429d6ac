"""Motors of joints from a CSV file: peak and continuous torque, speed, and the rotor behind its gear.

    joint, peak [N m], continuous [N m], speed [rad/s], gear_ratio, rotor_inertia [kg m^2], at
    shoulder_pan_joint, 150, 56, 3.15, 101, 1.2e-4, joint

Torques and speeds are at the joint, or, where the column `at` says "motor", at the shaft of the motor: then the torque
at the joint is the gear ratio times that, and the speed that divided by the ratio. A rotor is felt at the joint as the
inertia ratio² · rotor_inertia. [Siciliano et al. 2009, sec. 5.2]
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, pi
from pathlib import Path
from typing import Any, final

from robot_dyn.foundations import PlanError, nearest, read, shorten

_MOST_BYTES = 2**20
_HEAD = re.compile(r"\s*([a-z_ ]+?)\s*(?:\[(.*?)\])?\s*")
# units that a column may have, with their factors; those of joints that slide as well
_TORQUE = {"N m": 1.0, "Nm": 1.0, "N": 1.0}
_SPEED = {"rad/s": 1.0, "m/s": 1.0, "rpm": pi / 30, "deg/s": pi / 180}
_INERTIA = {"kg m^2": 1.0, "kg m²": 1.0, "kg": 1.0, "kg cm^2": 1e-4, "kg cm²": 1e-4, "g cm^2": 1e-7, "g cm²": 1e-7}
_UNITS: Mapping[str, Mapping[str, float]] = {
    "peak": _TORQUE,
    "continuous": _TORQUE,
    "speed": _SPEED,
    "gear_ratio": {"": 1.0},
    "rotor_inertia": _INERTIA,
}


@final
@dataclass(frozen=True, eq=False)
class Motors:
    """Motors by joint, at the joint; what is not stated is inf, or 0 for the rotor's inertia.

    Attributes:
        peak: Greatest torque, in [N m] or [N].
        continuous: Torque that may last, likewise.
        speed: Greatest speed, in [rad/s] or [m/s].
        armature: Inertia of the rotor behind its gear, in [kg m²] or [kg].
        source: The file.
    """

    peak: Mapping[str, float]
    continuous: Mapping[str, float]
    speed: Mapping[str, float]
    armature: Mapping[str, float]
    source: str = field(default="motors")


def read_motors(path: str | Path) -> Motors:
    """The motors of a CSV file; its first line names the columns, with their units in brackets.

    Columns: joint, peak [N m], continuous [N m], speed [rad/s], gear_ratio, rotor_inertia [kg m^2], at. All but `joint`
    and `peak` may be left out, and entries may be empty. [N] and [m/s] are of joints that slide; speeds may be in [rpm]
    or [deg/s]. `at` is "joint" or "motor": where torques and speeds are meant; it is asked for with gear ratios.

    Raises:
        PlanError: If it cannot be read, a column or unit is unknown, or an entry is not a positive number.
    """
    data = read(path, _MOST_BYTES, PlanError, "give a CSV file with columns joint, peak [N m] …")
    try:
        lines = csv.reader(data.decode("utf-8-sig").splitlines(), strict=True)
        heads = _heads(path, next(lines, []))
        rows = [_row(path, lines.line_num, heads, line) for line in lines if any(each.strip() for each in line)]
    except (UnicodeDecodeError, csv.Error) as error:
        raise PlanError(f"{path}: is not a CSV file in UTF-8 ({error}); write it again") from None
    if not rows:
        raise PlanError(f"{path}: names no motor; write a line for each joint")
    names = [row["joint"] for row in rows]
    if twice := next((name for k, name in enumerate(names) if name in names[:k]), None):
        raise PlanError(f"{path}: joint {shorten(twice)!r} is there twice; keep one line")
    columns = {
        key: {row["joint"]: row[key] for row in rows if row.get(key) is not None}
        for key in ("peak", "continuous", "speed")
    }
    armature = {row["joint"]: row["armature"] for row in rows if row["armature"]}
    return Motors(**columns, armature=armature, source=str(path))


def _heads(path: str | Path, heads: Sequence[str]) -> list[tuple[str, float]]:
    """Name and factor of each column."""
    found: list[tuple[str, float]] = []
    for head in heads:
        match = _HEAD.fullmatch(head)
        name, unit = (match[1].replace(" ", "_"), match[2]) if match else (head, None)
        if name not in (*_UNITS, "joint", "at") or name in (each for each, _ in found):
            known = nearest(name, (*_UNITS, "joint", "at"))
            raise PlanError(f"{path}: column {shorten(head)!r} is unknown or there twice; {known}")
        units = _UNITS.get(name, {"": 1.0})
        if (unit or "") not in units:
            listed = ", ".join(f"[{each}]" for each in units)
            raise PlanError(f"{path}: the unit of {name} must be one of {listed}, got {shorten(head)!r}")
        found.append((name, units[unit or ""]))
    names = [name for name, _ in found]
    for needed in ("joint", "peak", *(("at",) if "gear_ratio" in names else ())):
        if needed not in names:
            why = " (joint or motor: where torques and speeds are meant)" if needed == "at" else ""
            raise PlanError(f"{path}: there is no column {needed!r}{why}; name the columns in the first line")
    return found


def _row(path: str | Path, number: int, heads: list[tuple[str, float]], line: list[str]) -> dict[str, Any]:
    """Torques and speed at the joint, and the inertia of the rotor there."""
    if len(line) != len(heads):
        raise PlanError(f"{path}: line {number} has {len(line)} entries for {len(heads)} columns; correct it")
    texts = {name: text.strip() for (name, _), text in zip(heads, line, strict=True)}
    row: dict[str, Any] = {"joint": texts["joint"]}
    for name, factor in heads:
        if name in _UNITS and texts[name]:
            row[name] = factor * _positive(f"{path}: line {number}: {name}", texts[name])
    at, ratio = texts.get("at", "") or "joint", row.get("gear_ratio", 1.0)
    if at not in ("joint", "motor"):
        raise PlanError(f"{path}: line {number}: at must be joint or motor, got {shorten(at)!r}")
    if at == "motor" and "gear_ratio" not in row:
        raise PlanError(f"{path}: line {number}: values at the motor need its gear_ratio")
    if "rotor_inertia" in row and "gear_ratio" not in row:
        raise PlanError(f"{path}: line {number}: a rotor_inertia needs its gear_ratio, 1 without a gear")
    for name, power in (("peak", 1), ("continuous", 1), ("speed", -1)):
        if at == "motor" and name in row:
            row[name] *= ratio**power
    row["armature"] = ratio**2 * row.get("rotor_inertia", 0.0)
    return row


def _positive(what: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value < inf:
        raise PlanError(f"{what} must be a positive number, got {shorten(text)!r}")
    return value
