"""Sources of samples as columns by heading: CSV files, MCAP logs, data frames, dicts and arrays."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from robot_dyn.control.samples.csv_table import read_csv
from robot_dyn.control.samples.headings import name_of
from robot_dyn.control.samples.joint_states import SUFFIX, TIMES, read_joint_states
from robot_dyn.foundations.errors import PlanError, shorten, shown
from robot_dyn.foundations.validate import numbers

TIME_NAMES = "t", "time", "timestamp", "stamp"


class Table(NamedTuple):
    """Columns by heading; of a log its times, (m,), in [s], and a note of where they are from."""

    columns: dict[str, np.ndarray]
    t: np.ndarray | None = None
    note: str = ""


def table_of(source: Any, joint_names: tuple[str, ...], joints: Mapping[str, Any], topic: Any, time: Any) -> Table:
    """The columns of a source; of an array without headings, those of the joints.

    Raises:
        PlanError: If it cannot be read, or a column is there twice.
    """
    is_file = isinstance(source, str | Path)
    if is_file and Path(source).suffix.lower() == SUFFIX:
        names = tuple(each for each in joints.values() if isinstance(each, str)) or joint_names
        states = read_joint_states(source, names, topic, time)
        return Table(states.columns, states.t, states.note)
    if topic is not None or (isinstance(time, str) and time in TIMES and not is_file):
        what = f"topic={shown(topic)}" if topic is not None else f"time={time!r}"
        if topic is not None or not _has(source, time):
            raise PlanError(f"{what} is of an MCAP log, and the samples are not of one; leave it out")
    if is_file:
        return Table(read_csv(source))
    if hasattr(source, "columns") and hasattr(source, "to_numpy"):
        return Table(_of_frame(source, indexed=time is None or isinstance(time, str)))
    if isinstance(source, Mapping):
        try:
            return Table({str(head): np.asarray(x) for head, x in source.items()})
        except Exception:  # a ragged list, or whatever an object's conversion raises
            raise PlanError(f"samples: columns must be arrays of one length, got {shown(source)}") from None
    rows = numbers("samples", source, ("m", len(joint_names)), error=PlanError)
    return Table(dict(zip(joint_names, rows.T, strict=True)))


def _has(source: Any, column: str) -> bool:
    return column in getattr(source, "columns", source if isinstance(source, Mapping) else ())


def _of_frame(frame: Any, *, indexed: bool) -> dict[str, np.ndarray]:
    """The columns of a data frame, and, if times are looked for, its index if that is named as they are."""
    heads = list(map(str, frame.columns))
    if twice := next((each for k, each in enumerate(heads) if each in heads[:k]), None):
        raise PlanError(f"samples: column {shorten(twice)!r} is there twice; keep one")
    columns = {head: _values(frame[of]) for head, of in zip(heads, frame.columns, strict=True)}
    index = getattr(frame, "index", None) if indexed else None  # of pandas
    name = getattr(index, "name", None)
    if name is not None and name_of(str(name)).lower() in TIME_NAMES and str(name) not in columns:
        columns = {str(name): _values(index), **columns}
    return columns


def _values(column: Any) -> np.ndarray:
    """A column as an array; stamps with a time zone, which to_numpy leaves as objects, as stamps of UTC."""
    if str(column.dtype).startswith("datetime64[ns, "):
        return column.to_numpy("datetime64[ns]")
    return column.to_numpy()
