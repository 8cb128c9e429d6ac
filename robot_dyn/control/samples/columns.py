"""Samples of an arm from the columns of a table: which column is the time and which a joint, in which unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.control.samples.headings import name_of, size, unit_of
from robot_dyn.control.samples.sources import TIME_NAMES, Table, table_of
from robot_dyn.foundations.errors import PlanError, nearest, shown
from robot_dyn.foundations.validate import choice, instance, number, numbers
from robot_dyn.model.robot import Robot

_BESIDE = r"([vau]|tau|power|start|desired|deviation) .*|energy|residual|.* state \d+"
_OF_A_RUN = re.compile(_BESIDE)  # headings beside t and q in the table of a run
_LARGEST = 1e12  # [rad] or [m]: far beyond any joint, and no power of it overflows
_STEPS = 1e-12, 1e15  # [s]: no fifth power of such a step vanishes or overflows
_NAME_JOINTS = "joints={joint: column}, --joint JOINT=COLUMN on the command line"


@final
@dataclass(frozen=True, eq=False)
class Columns:
    """The samples of a table.

    Attributes:
        t: Times, (m,), in [s].
        q: Positions, (m, n), in [m], and in [rad] unless they are in degrees.
        stated: Whether the unit of each joint is known, (n,).
        given: Whether the table has a column of each joint, (n,); the others rest at q0.
        of_time: Whether the unit of the times is known.
        more: v and a, (m, n), if the table is that of a run.
        note: Of a log: topic and times.
    """

    t: np.ndarray
    q: np.ndarray
    stated: np.ndarray
    given: np.ndarray
    of_time: bool
    more: dict[str, np.ndarray]
    note: str


def columns(
    arm: Robot,
    source: Any,
    time: Any = None,
    joints: Any = None,
    unit: Any = None,
    q0: Any = None,
    topic: Any = None,
    least: int = 2,
) -> Columns:
    """The samples of a source, so many at least; see `from_samples`."""
    if unit is not None:
        choice("unit", unit, ("rad", "deg"), error=PlanError)
    if joints is not None:
        instance("joints", joints, Mapping, "give the column of each joint, {joint: column}", error=PlanError)
    table = table_of(source, arm.joint_names, joints or {}, topic, time)
    heads, t, of_time = _times(table, time, least)
    at = _joints(arm, heads, joints)
    if absent := [name for name in arm.joint_names if name not in at]:
        close = nearest(absent[0], heads)
        remedy = f"name it by {_NAME_JOINTS}"
        if q0 is None:
            raise PlanError(
                f"there is no column of {', '.join(absent)}; {close}; {remedy}, or say where it rests by q0"
            )
        if not at:
            raise PlanError(f"there is no column of any joint; {close}; {remedy}")
    rests = np.zeros(arm.n) if q0 is None else numbers("q0", q0, (arm.n,), error=PlanError)
    q, stated = np.tile(rests, (len(t), 1)), np.ones(arm.n, bool)
    for i, (name, kind) in enumerate(zip(arm.joint_names, arm.joint_types, strict=True)):
        if name in at:
            head = at[name]
            factor, stated[i] = size(head, "length" if kind == "prismatic" else "angle", unit)
            q[:, i] = factor * _finite(head, heads[head])
            for k in np.flatnonzero(np.abs(q[:, i]) > _LARGEST)[:1]:
                unit = "m" if kind == "prismatic" else "rad"
                raise PlanError(
                    f"column {shown(head)}: sample {k + 1} is {q[k, i]:.3g} {unit}, beyond {_LARGEST:g} {unit};"
                    " correct it, or leave it out"
                )
    more = {} if joints is not None else _rates(arm, heads, unit)
    given = np.array([name in at for name in arm.joint_names])
    return Columns(t, q, stated, given, of_time, more, table.note)


def _times(table: Table, time: Any, least: int) -> tuple[dict[str, np.ndarray], np.ndarray, bool]:
    """The other columns, the times in [s], and whether their unit is known."""
    heads, stated = table.columns, True
    lengths = {len(x) if x.ndim == 1 else 0 for x in heads.values()}
    if len(lengths) != 1 or max(lengths) < least:
        counts = ", ".join(f"{shown(head)} {len(x) if x.ndim else 'no'}" for head, x in list(heads.items())[:4])
        raise PlanError(f"samples: columns must be of one length, of {least} samples at least; got {counts or 'none'}")
    (m,) = lengths
    if table.t is not None:
        t = table.t
    elif time is None or isinstance(time, str):
        head = _time_heading(heads, time)
        t, (factor, stated) = heads[head], size(head, "time")
        if t.dtype.kind in "Mm":
            t, stated = _since_first(head, t), True
        t = factor * _finite(head, t)
        heads = {each: x for each, x in heads.items() if each != head}
    elif isinstance(time, int | float):
        with np.errstate(over="ignore"):  # refused below
            t = number("time", time, error=PlanError, above=0) * np.arange(m)
    else:
        t = numbers("time", time, (m,), error=PlanError)
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(t)
    for k in np.flatnonzero(steps <= 0)[:1]:
        remedy = "sort them, or leave out what is there twice"
        if table.t is not None:
            remedy = "take the other times, time='log' or time='header', or mend the log"
        raise PlanError(
            f"times must increase: sample {k + 2} is at {t[k + 1]:.9g} s, the one before at {t[k]:.9g} s; {remedy}"
        )
    for k in np.flatnonzero(~((steps >= _STEPS[0]) & (steps <= _STEPS[1])))[:1]:
        raise PlanError(
            f"times: sample {k + 2} is {steps[k]:.3g} s after the one before it; the time between samples must be"
            f" {_STEPS[0]:g} to {_STEPS[1]:g} s; check the unit of the times"
        )
    return heads, t, stated


def _time_heading(heads: Mapping[str, np.ndarray], time: str | None) -> str:
    """The heading of the times: the one asked for, or the only one that is named as times are."""
    if time is not None:
        return _heading(time, heads)
    named = [head for head in heads if name_of(head).lower() in TIME_NAMES]
    if len(named) != 1:
        what = (
            f"{len(named)} columns may be the time, {', '.join(map(shown, named))}"
            if named
            else (f"there is no column of time; {nearest('t', heads)}")
        )
        raise PlanError(
            f"{what}; give time=…, a column, times, or a period in s; --time COLUMN or --period"
            " SECONDS on the command line"
        )
    return named[0]


def _heading(name: Any, heads: Mapping[str, np.ndarray]) -> str:
    """The heading that is asked for, as it is or without its unit."""
    without_unit = [head for head in heads if name_of(head) == name]
    if name not in heads and len(without_unit) == 1:
        return without_unit[0]
    return choice("column", name, heads, error=PlanError)


def _since_first(head: str, t: np.ndarray) -> np.ndarray:
    """Stamps, or spans, of any resolution as times in [s] from the first."""
    for k in np.flatnonzero(np.isnat(t))[:1]:
        raise PlanError(f"column {shown(head)}: sample {k + 1} is NaT; fill it in, or leave it out")
    return (t - t[0]).astype("timedelta64[ns]").astype(float) * 1e-9


def _joints(arm: Robot, table: dict[str, np.ndarray], joints: Mapping[str, Any] | None) -> dict[str, str]:
    """The heading of each joint that has a column."""
    if joints is not None:
        for joint in joints:
            choice("joint", joint, arm.joint_names, error=PlanError)
        named = {joint: _heading(head, table) for joint, head in joints.items()}
        if twice := [head for head in named.values() if list(named.values()).count(head) > 1]:
            raise PlanError(f"joints: column {shown(twice[0])} is given for several joints; name another column")
        return named
    of_a_run = any(name_of(head).startswith("q ") for head in table)
    found: dict[str, str] = {}
    for head in table:
        text = name_of(head)
        if of_a_run and _OF_A_RUN.fullmatch(text):
            continue
        name = text.removeprefix("q ").strip() if of_a_run else text
        if name not in arm.joint_names:
            if name.lower() in TIME_NAMES:
                raise PlanError(
                    f"column {shown(head)} is of times, and time= gives others, or --time or --period;"
                    " leave one of them out"
                )
            close = nearest(name, arm.joint_names)
            raise PlanError(f"column {shown(head)} is of no joint; {close}; choose columns by {_NAME_JOINTS}")
        if name in found:
            raise PlanError(f"columns {shown(found[name])} and {shown(head)} are of one joint; keep one")
        found[name] = head
    return found


def _rates(arm: Robot, table: dict[str, np.ndarray], unit: str | None) -> dict[str, np.ndarray]:
    """The rates v and a of a run's table, where it has them of all joints."""
    by_text = {name_of(head): (head, x) for head, x in table.items()}
    of_q = {unit_of(head) for name, (head, _) in by_text.items() if name.startswith("q ")} | {unit}
    unknown = (None,) if of_q <= {None, "rad", "m"} else ()  # of rates beside angles in degrees, a unit is asked for
    rates = {}
    for key, units in (("v", ("rad/s", "m/s")), ("a", ("rad/s²", "m/s²"))):
        heads = [by_text.get(f"{key} {name}") for name in arm.joint_names]
        if not all(heads) or (key == "a" and not rates):
            break
        for head, _ in filter(None, heads):
            if unit_of(head) not in (*unknown, *units):
                raise PlanError(f"column {shown(head)}: is not in {' or '.join(units)}; state that, or leave it out")
        rates[key] = np.array([_finite(*each) for each in heads if each]).T
    return rates


def _finite(head: str, x: np.ndarray) -> np.ndarray:
    """A column of finite numbers; PlanError names the first that is not."""
    if x.dtype.kind not in "fiu":
        odd = next((k for k, each in enumerate(x.tolist()) if type(each) not in (int, float)), 0)
        raise PlanError(f"column {shown(head)} must hold numbers, sample {odd + 1} is {shown(x.tolist()[odd])}")
    for k in np.flatnonzero(~np.isfinite(x))[:1]:
        raise PlanError(f"column {shown(head)}: sample {k + 1} is {x[k]}; fill it in, or leave it out")
    return x.astype(float)
