"""Motors of joints from a CSV file: peak and continuous torque, speed, gear and rotor.

    joint, peak [N m], continuous [N m], speed [rad/s], gear_ratio, rotor_inertia [kg m^2], at
    shoulder_pan_joint, 150, 56, 3.15, 101, 1.2e-4, joint

Torques and speeds are at the joint, or at the motor shaft if the column `at` is "motor": the gear ratio then multiplies
the torque and divides the speed. A rotor adds the inertia ratio² · rotor_inertia at the joint. A joint with several
lines has a motor whose torques fall with speed: each line is a corner of its torque–speed line, see `Motors.line`.
A column `efficiency` states the losses of gears, for torques at the motor, and `brake` the holding torque of a brake.
Columns `bearing axial [N]` and others limit the loads on the bearing of the joint.
[Siciliano et al. 2009, sec. 5.2]
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from math import inf, pi
from pathlib import Path
from typing import Any, final

import numpy as np

from robot_dyn.effects import AT, Points, TorqueSpeedLimit, check_line, check_speed
from robot_dyn.foundations import PlanError, csv_rows, shorten

_MOST_BYTES = 2**20
_HEAD = re.compile(r"\s*([a-z_ ]+?)\s*(?:\[(.*?)\])?\s*")
# units of columns with their factors, including units of prismatic joints
_TORQUE = {"N m": 1.0, "Nm": 1.0, "N": 1.0}
_FORCE, _MOMENT = {"N": 1.0, "kN": 1e3}, {"N m": 1.0, "Nm": 1.0}
_SPEED = {"rad/s": 1.0, "m/s": 1.0, "rpm": pi / 30, "deg/s": pi / 180}
_INERTIA = {"kg m^2": 1.0, "kg m²": 1.0, "kg": 1.0, "kg cm^2": 1e-4, "kg cm²": 1e-4, "g cm^2": 1e-7, "g cm²": 1e-7}
_UNITS: Mapping[str, Mapping[str, float]] = {
    "joint": {"": 1.0},
    "at": {"": 1.0},
    "peak": _TORQUE,
    "continuous": _TORQUE,
    "brake": _TORQUE,
    "bearing_axial": _FORCE,
    "bearing_radial": _FORCE,
    "bearing_tilting": _MOMENT,
    "bearing_torsion": _MOMENT,
    "speed": _SPEED,
    "gear_ratio": {"": 1.0},
    "rotor_inertia": _INERTIA,
    "efficiency": {"": 1.0, "%": 0.01},
}
_BEARING = tuple(name for name in _UNITS if name.startswith("bearing_"))
_OF_CORNERS = "speed", "peak", "continuous"  # may be 0 at a corner
_OF_FIRST = "at", "gear_ratio", "rotor_inertia", "efficiency", "brake", *_BEARING  # stated once for a joint
_LEAST_RATIO, _LEAST_EFFICIENCY, _BRAKES = 0.5, 0.05, 20.0  # smaller ones, and brakes that differ more, are mistakes


@final
@dataclass(frozen=True, eq=False)
class Motors:
    """Motors by joint, with values at the joint; joints without a value have no limit, or no rotor inertia.

    A line has the corners (speed, torque) of a polyline, in [rad/s] and [N m], or [m/s] and [N]. A motor that drives
    (τ v > 0) gives up to its line, one that brakes its peak torque; the last speed is its largest one.

    Attributes:
        peak: Peak torque, in [N m] or [N].
        continuous: Continuous torque, in [N m] or [N].
        speed: Largest speed, in [rad/s] or [m/s].
        armature: Inertia of the rotor at the joint, in [kg m²] or [kg].
        source: Path of the file.
        line: Peak torque by speed.
        continuous_line: Continuous torque by mean speed.
        efficiency: η of the gear, above 0 and at most 1: driving motors supply 1/η of the torque through the gear, and
            motors that are driven back supply η of it. Joints without a value have gears without losses.
        brake: Holding torque of a brake, in [N m] or [N]; joints without a value have no brake.
        bearing: Largest "axial" and "radial" force, in [N], "tilting" moment and "torsion", in [N m], that a bearing
            bears; loads left out have no limit.
    """

    peak: Mapping[str, float]
    continuous: Mapping[str, float]
    speed: Mapping[str, float]
    armature: Mapping[str, float]
    source: str = field(default="motors")
    line: Mapping[str, Points] = field(default_factory=dict)
    continuous_line: Mapping[str, Points] = field(default_factory=dict)
    efficiency: Mapping[str, float] = field(default_factory=dict)
    brake: Mapping[str, float] = field(default_factory=dict)
    bearing: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def limit(self) -> TorqueSpeedLimit:
        """The effect that limits the actuation of a plant to the lines.

        Raises:
            PlanError: If there is no line, or one does not end with a torque of 0, at the no-load speed.
        """
        if not self.line:
            raise PlanError(f"{self.source}: no joint has a torque–speed line; use an EffortLimit with motors.peak")
        for joint, points in self.line.items():
            if points[-1][1]:
                raise PlanError(
                    f"{self.source}: the line of {joint!r} ends with {points[-1][1]:g} N m, but a run may exceed this"
                    " speed: add the no-load speed, with a peak of 0"
                )
        speed, torque = ({joint: [p[k] for p in points] for joint, points in self.line.items()} for k in (0, 1))
        return TorqueSpeedLimit(speed, torque)


def read_motors(path: str | Path) -> Motors:
    """Read the motors of a CSV file; the first line names the columns, with units in brackets.

    Columns: joint, peak [N m], continuous [N m], speed [rad/s], gear_ratio, rotor_inertia [kg m^2], efficiency,
    brake [N m], at; and bearing axial [N], bearing radial [N], bearing tilting [N m], bearing torsion [N m]. All except
    `joint` and `peak` are optional, and entries may be empty. Prismatic joints have [N] and [m/s]; speeds may be in
    [rpm] or [deg/s], efficiencies in [%]. `at` is "joint" or "motor", the place of torques and speeds, but not of loads
    on bearings; it is required with gear ratios. An efficiency needs torques at the motor: those at the joint contain
    the loss.

    Several lines of one joint are the corners of its torque–speed line, with increasing speeds and peaks that do not
    increase; those with a continuous torque are the corners of a second line. The first states at, gear, rotor,
    efficiency, brake and bearing.

    Raises:
        PlanError: If the file cannot be read, a column or unit is unknown, an entry is not a positive number, corners
            are not a torque–speed line, a continuous torque exceeds the peak, a speed above 100 rad/s is at the joint,
            a gear ratio is below 0.5, a brake and a peak differ by more than a factor of 20, or an efficiency is above
            1, below 0.05, or of torques at the joint.
    """
    lines = csv_rows(path, _MOST_BYTES, PlanError, "give a CSV file with columns joint, peak [N m] …", skip_blank=True)
    heads = _heads(path, next(lines)[1])
    corners: dict[str, list[dict[str, Any]]] = {}
    for where, line in lines:
        row = _row(where, heads, line)
        corners.setdefault(row["joint"], []).append(row)
    if not corners:
        raise PlanError(f"{path}: contains no motors; add a line for each joint")
    rows = [_motor(joint) for joint in corners.values()]
    columns = {
        column.name: {row["joint"]: row[column.name] for row in rows if row.get(column.name)}
        for column in fields(Motors)
        if column.name != "source"
    }
    return Motors(**columns, source=str(path))


def _heads(path: str | Path, heads: Sequence[str]) -> dict[str, float]:
    """Return the factor of each column, by name."""
    factors: dict[str, float] = {}
    for head in heads:
        match = _HEAD.fullmatch(head)
        name, unit = (match[1].replace(" ", "_"), match[2] or "") if match else (head, "")
        if name not in _UNITS or name in factors:
            remedy = f"the columns of motors are {', '.join(_UNITS)}" if name not in _UNITS else "keep one"
            raise PlanError(
                f"{path}: column {shorten(head)!r} is {'repeated' if name in factors else 'unknown'}; {remedy}"
            )
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
    """Return the entries of a line in SI units, with its place in the file."""
    texts = {name: text.strip() for name, text in zip(factors, line, strict=True)}
    row: dict[str, Any] = {"joint": texts.pop("joint"), "where": where, "at": texts.pop("at", "")}
    return row | {name: factors[name] * _number(f"{where}: {name}", text) for name, text in texts.items() if text}


def _motor(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return torques, speed and lines at the joint, and the inertia of the rotor there, of the lines of a joint."""
    first, where, joint = rows[0], rows[0]["where"], rows[0]["joint"]
    at, ratio = first["at"] or AT[0], first.get("gear_ratio", 1.0)
    if at not in AT:
        raise PlanError(f"{where}: at must be joint or motor, got {shorten(at)!r}")
    for row in rows:
        _check(row, first, at, is_corner=len(rows) > 1)
    N = ratio if at == "motor" else 1.0
    motor = {name: N * first[name] for name in ("peak", "continuous", "brake") if name in first}
    motor["bearing"] = {name.removeprefix("bearing_"): first[name] for name in _BEARING if name in first}
    motor |= {"joint": joint, "armature": ratio**2 * first.get("rotor_inertia", 0.0)}
    motor |= {"efficiency": first["efficiency"]} if first.get("efficiency", 1.0) < 1 else {}
    if "speed" in first:
        motor["speed"] = rows[-1]["speed"] / N
    for name, line in (("peak", "line"), ("continuous", "continuous_line")):
        corners = [(row["speed"] / N, N * row[name]) for row in rows if len(rows) > 1 and name in row]
        if corners:
            speed, torque = np.transpose(corners)
            check_line(f"{where}: {name} of {joint}", speed, torque, PlanError)
            motor |= {line: tuple(corners), name: corners[0][1]}
    return motor


def _check(row: Mapping[str, Any], first: Mapping[str, Any], at: str, *, is_corner: bool) -> None:
    """Raise a PlanError for a mistake in a line of a joint, whose first line is `first`."""
    joint, efficiency, ratio = row["joint"], row.get("efficiency", 1.0), row.get("gear_ratio", 1.0)
    peak = row.get("peak", inf)
    continuous, brake = row.get("continuous", 0.0), row.get("brake", peak)
    other = [name for name in _OF_FIRST if row.get(name, "") not in ("", first.get(name))]
    zero = [name for name in _UNITS if row.get(name) == 0 and not (is_corner and name in _OF_CORNERS)]
    mistakes = (
        (other, f"{joint!r} has another {', '.join(other)} in its first line; keep that one"),
        (zero, f"{', '.join(zero)} must be a positive number, got 0"),
        (
            is_corner and "speed" not in row,
            f"joint {shorten(joint)!r} appears twice; keep one line, or give a speed in each: they are the corners of"
            " its torque–speed line",
        ),
        (
            "gear_ratio" not in first and (at == "motor" or "rotor_inertia" in first),
            "values at the motor and a rotor_inertia need a gear_ratio; give 1 without a gear",
        ),
        (
            ratio < _LEAST_RATIO,
            f"gear_ratio is the speed of the motor over that of the joint, got {ratio:.4g}; write its reciprocal",
        ),
        (efficiency > 1, f"efficiency must be at most 1, got {efficiency:.4g}; write percent as 'efficiency [%]'"),
        (
            efficiency < _LEAST_EFFICIENCY,
            f"efficiency {efficiency:.4g} leaves almost no torque; write 80 % as 0.8, or as 80 in 'efficiency [%]'",
        ),
        (
            "efficiency" in row and at != "motor",
            "torques at the joint contain the losses of the gear; leave efficiency empty, or state torques at the"
            " motor",
        ),
        (continuous > peak, f"the continuous torque {continuous:.4g} exceeds the peak {peak:.4g}; correct one of them"),
        (
            row is first and 0 < peak < inf and not 1 / _BRAKES <= brake / peak <= _BRAKES,
            f"the brake, {brake:.4g}, and the peak, {peak:.4g}, differ by more than a factor of {_BRAKES:g}; give both"
            f" at the {at}",
        ),
    )
    for is_made, mistake in mistakes:
        if is_made:
            raise PlanError(f"{row['where']}: {mistake}")
    if at == "joint" and "speed" in row:
        check_speed(f"{row['where']}: speed", row["speed"], PlanError)


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < inf:
        raise PlanError(f"{name} must be a positive number, got {shorten(text)!r}")
    return value
