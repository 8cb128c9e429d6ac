"""Recorded motions: samples of an arm from a table, in SI units, after a search for its columns of times and joints."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn.control.samples.sources import table_of
from robot_dyn.control.samples.table import TIME_NAMES, Table, is_text, name_of, size, unit_of
from robot_dyn.foundations.errors import PlanError, nearest, shown
from robot_dyn.foundations.validate import choice, in_order, instance, number, numbers
from robot_dyn.model.robot import Robot
from robot_dyn.queries.units import of_joint

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from robot_dyn.control.samples.sources import Source
    from robot_dyn.foundations.validate import JointValues


# headings other than t and q in the table of a run
_RUN_HEADINGS = re.compile(r"([vau]|tau|power|start|desired|tracking error) .*|energy|residual|.* state \d+")
_LARGEST = 1e12  # [rad] or [m]: far beyond any joint, and its powers do not overflow
_FEW, _PART = 3, 0.1  # smallest number, and fraction of the samples, whose times go back in two interleaved series
TWO_PUBLISHERS = "keep the samples of one, or record its topic alone"
_STEPS = 1e-12, 1e15  # [s]: fifth powers of such steps neither vanish nor overflow
_NAME_JOINTS = "joints={joint: column} (--joint JOINT=COLUMN)"


@final
@dataclass(frozen=True, eq=False)
class Recorded:
    """Samples of an arm.

    Attributes:
        arm: The robot.
        t: Times, (m,), in [s].
        q: Positions, (m, n), in [m] or [rad]; unconverted where the unit is unknown.
        stated: True for joints with a known unit, (n,).
        has_column: True for joints with a column, (n,); the others rest at q0.
        has_time_unit: True if the unit of the times is known.
        more: v and a, (m, n), if the table is the export of a run.
        note: Topic of a log, origin of its times, and skipped columns of text.
    """

    arm: Robot
    t: np.ndarray
    q: np.ndarray
    stated: np.ndarray
    has_column: np.ndarray
    has_time_unit: bool
    more: dict[str, np.ndarray]
    note: str

    @cached_property
    def dt(self) -> np.ndarray:
        """Times between samples, (m − 1,), in [s]."""
        return np.diff(self.t)

    @cached_property
    def speed(self) -> np.ndarray:
        """Velocities between samples, (m − 1, n), in [rad/s] or [m/s]."""
        return np.diff(self.q, axis=0) / self.dt[:, None]

    @property
    def limit(self) -> np.ndarray:
        """Velocity limits of the arm, (n,), inf where its file states none or 0."""
        return np.where(self.arm.velocity_limit > 0, self.arm.velocity_limit, np.inf)

    def unit(self, joint: int, revolute: str = "rad") -> str:
        """Return the unit of a quantity of a joint; `revolute` is its unit for a revolute joint."""
        return of_joint(revolute, self.arm.joint_types[joint])


def recorded(
    arm: Robot,
    source: Source,
    time: ArrayLike | None = None,
    joints: Mapping[str, str] | None = None,
    unit: str | None = None,
    q0: JointValues | None = None,
    topic: str | None = None,
    least: int = 2,
) -> Recorded:
    """Return the samples of a source, at least `least`; see `from_samples`."""
    if unit is not None:
        choice("unit", unit, ("rad", "deg"), error=PlanError)
    if joints is not None:
        instance("joints", joints, Mapping, "give the column of each joint, {joint: column}", error=PlanError)
    table = table_of(source, arm.joint_names, joints or {}, topic, time)
    heads, t, has_time_unit = _times(table, time, least, str(source) if isinstance(source, str | Path) else "samples")
    at = _joints(arm, heads, joints)
    skipped = [head for head, column in heads.items() if head not in at.values() and is_text(column)]
    note = "; ".join([table.note] * bool(table.note) + [f"without the text columns {shown(skipped)}"] * bool(skipped))
    absent = [name for name in arm.joint_names if name not in at]
    if absent and (q0 is None or not at):
        names, rest = (
            ("any joint", "")
            if q0 is not None
            else (", ".join(absent), ", or give its rest position in q0 (--lock JOINT=VALUE)")
        )
        raise PlanError(f"there is no column of {names}; {nearest(absent[0], heads)}; name it by {_NAME_JOINTS}{rest}")
    rests = np.zeros(arm.n) if q0 is None else _rests(arm, q0)
    q, stated = np.tile(rests, (len(t), 1)), np.ones(arm.n, bool)
    for i, (name, kind) in enumerate(zip(arm.joint_names, arm.joint_types, strict=True)):
        if (head := at.get(name)) is not None:
            factor, stated[i] = size(head, "length" if kind == "prismatic" else "angle", unit)
            q[:, i] = factor * _finite(head, heads[head])
            for k in np.flatnonzero(np.abs(q[:, i]) > _LARGEST)[:1]:
                si = of_joint("rad", kind)
                raise PlanError(
                    f"column {shown(head)}: sample {k + 1} is {q[k, i]:.3g} {si}, beyond {_LARGEST:g} {si};"
                    " correct or remove it"
                )
    more = {} if joints is not None else _rates(arm, heads, unit)
    has_column = np.array([name in at for name in arm.joint_names])
    return Recorded(arm, t, q, stated, has_column, has_time_unit, more, note)


def _rests(arm: Robot, q0: JointValues) -> np.ndarray:
    """Return the rest positions of joints without a column, (n,)."""
    return numbers("q0", in_order("q0", q0, arm.joint_names, error=PlanError), (arm.n,), error=PlanError)


def _times(
    table: Table, time: ArrayLike | None, least: int, where: str
) -> tuple[dict[str, np.ndarray], np.ndarray, bool]:
    """Return the other columns, the times in [s], and True if their unit is known."""
    heads, stated = table.columns, True
    lengths = {len(x) if x.ndim == 1 else 0 for x in heads.values()}
    if len(lengths) != 1 or max(lengths) < least:
        counts = ", ".join(f"{shown(head)} {len(x) if x.ndim else 'no'}" for head, x in list(heads.items())[:4])
        raise PlanError(f"{where}: columns must have equal lengths of at least {least}; got {counts or 'none'}")
    (m,) = lengths
    if table.t is not None:
        t = table.t
    elif time is None or isinstance(time, str):
        head = _time_heading(heads, time)
        t, (factor, stated) = heads[head], size(head, "time")
        if t.dtype.kind in "Mm":
            t, stated = _since_first(head, t), True
        t = factor * _finite(head, t)
        heads = {other: x for other, x in heads.items() if other != head}
    elif isinstance(time, int | float):
        with np.errstate(over="ignore"):  # refused below
            t = number("time between samples", time, error=PlanError, above=0) * np.arange(m)
    else:
        t = numbers("time", time, (m,), error=PlanError)
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(t)
    for k in np.flatnonzero(steps <= 0)[:1]:
        _refuse_two_series(t)
        remedy = "sort the samples, or remove duplicates"
        if table.t is not None:
            remedy = "use the other times, time='log' or time='header', or repair the log"
        raise PlanError(
            f"times must increase: sample {k + 2} is at {t[k + 1]:.9g} s, the previous one at {t[k]:.9g} s; {remedy}"
        )
    for k in np.flatnonzero(~((steps >= _STEPS[0]) & (steps <= _STEPS[1])))[:1]:
        raise PlanError(
            f"times: sample {k + 2} is {steps[k]:.3g} s after the previous one; the time between samples must be"
            f" {_STEPS[0]:g} to {_STEPS[1]:g} s; check the unit of the times"
        )
    return heads, t, stated


def _refuse_two_series(t: np.ndarray) -> None:
    """Raise a PlanError if times alternate between two increasing series."""
    back = np.flatnonzero(np.diff(t) <= 0)
    if len(back) < max(_FEW, _PART * len(t)):
        return
    lower, upper = -np.inf, -np.inf  # last time of each series
    for x in t.tolist():
        if x <= lower:
            return  # not two increasing series
        lower, upper = (lower, x) if x > upper else sorted((x, upper))
    k, pairs = back[0], (np.diff(t)[back] == 0).all()
    fault = "repeat" if pairs else "go back"
    single = "write the times with more digits" if pairs else "sort the samples"
    raise PlanError(
        f"two publishers appear to be interleaved: times {fault} at {len(back)} of {len(t)} samples, first from"
        f" {t[k]:.9g} to {t[k + 1]:.9g} s at sample {k + 2}; {TWO_PUBLISHERS}; if there is"
        f" only one, {single}"
    )


def _time_heading(heads: Mapping[str, np.ndarray], time: str | None) -> str:
    """Return the requested heading of the times, or the only heading with the name of a time."""
    if time is not None:
        return _heading(time, heads)
    named = [head for head in heads if name_of(head).lower() in TIME_NAMES]
    if len(named) == 1:
        return named[0]
    fault = f"there is no column of time; {nearest('t', heads)}"
    if named:
        fault = f"{len(named)} columns may be the time, {', '.join(map(shown, named))}"
    remedy = "give time=…, a column, times, or a period in s; --time COLUMN or --period SECONDS on the command line"
    raise PlanError(f"{fault}; {remedy}")


def _heading(name: str, heads: Mapping[str, np.ndarray]) -> str:
    """Return the requested heading, which may be passed without its unit."""
    without_unit = [head for head in heads if name_of(head) == name]
    if name not in heads and len(without_unit) == 1:
        return without_unit[0]
    return choice("column", name, heads, error=PlanError)


def _since_first(head: str, t: np.ndarray) -> np.ndarray:
    """Return stamps or time spans of any resolution as times in [s] since the first."""
    for k in np.flatnonzero(np.isnat(t))[:1]:
        raise PlanError(f"column {shown(head)}: sample {k + 1} is NaT; fill it in, or remove the sample")
    return (t - t[0]).astype("timedelta64[ns]").astype(float) * 1e-9


def _joints(arm: Robot, heads: Mapping[str, np.ndarray], joints: Mapping[str, str] | None) -> dict[str, str]:
    """Return the heading of each joint that has a column."""
    if joints is not None:
        for joint in joints:
            choice("joint", joint, arm.joint_names, error=PlanError)
        named = {joint: _heading(head, heads) for joint, head in joints.items()}
        if twice := [head for head in named.values() if list(named.values()).count(head) > 1]:
            raise PlanError(f"joints: column {shown(twice[0])} is given for several joints; name another column")
        return named
    of_a_run = any(name_of(head).startswith("q ") for head in heads)
    by_joint: dict[str, str] = {}
    for head in heads:
        name = name_of(head)
        if of_a_run and _RUN_HEADINGS.fullmatch(name):
            continue
        name = name.removeprefix("q ").strip() if of_a_run else name
        if name not in arm.joint_names and is_text(heads[head]):
            continue
        if name not in arm.joint_names and name.lower() in TIME_NAMES:
            others = "time= (--time or --period) gives times, too; remove one of them"
            raise PlanError(f"column {shown(head)} contains times, but {others}")
        if name not in arm.joint_names:
            close = nearest(name, arm.joint_names)
            raise PlanError(f"column {shown(head)} is not a joint; {close}; choose columns by {_NAME_JOINTS}")
        if name in by_joint:
            raise PlanError(f"columns {shown(by_joint[name])} and {shown(head)} belong to the same joint; keep one")
        by_joint[name] = head
    return by_joint


def _rates(arm: Robot, heads: Mapping[str, np.ndarray], unit: str | None) -> dict[str, np.ndarray]:
    """Return the rates v and a of a run's table, if it has them for all joints."""
    by_name = {name_of(head): head for head in heads}
    of_q = {unit_of(head) for name, head in by_name.items() if name.startswith("q ")} | {unit}
    unknown = (None,) if of_q <= {None, "rad", "m"} else ()  # rates next to angles in degrees must state a unit
    rates = {}
    for key, units in (("v", ("rad/s", "m/s")), ("a", ("rad/s²", "m/s²"))):
        columns = [by_name[f"{key} {name}"] for name in arm.joint_names if f"{key} {name}" in by_name]
        if len(columns) < arm.n or (key == "a" and not rates):
            break
        for head in columns:
            if unit_of(head) not in (*unknown, *units):
                raise PlanError(f"column {shown(head)} must be in {' or '.join(units)}; state the unit, or remove it")
        rates[key] = np.array([_finite(head, heads[head]) for head in columns]).T
    return rates


def _finite(head: str, x: np.ndarray) -> np.ndarray:
    """Return a column of finite numbers; raise a PlanError about the first other entry."""
    if x.dtype.kind not in "fiu":
        odd = next((k for k, entry in enumerate(x.tolist()) if type(entry) not in (int, float)), 0)
        raise PlanError(f"column {shown(head)} must contain numbers, sample {odd + 1} is {shown(x.tolist()[odd])}")
    for k in np.flatnonzero(~np.isfinite(x))[:1]:
        raise PlanError(f"column {shown(head)}: sample {k + 1} is {x[k]}; fill it in, or remove the sample")
    return x.astype(float)
