"""Sources of samples as tables: CSV files, MCAP logs, data frames, dicts and arrays.

In a CSV file the first line names the columns, commas separate them, and decimals have a point.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from robot_dyn.control.samples.joint_states import SUFFIX, TIMES, read_joint_states
from robot_dyn.control.samples.other_files import refuse_other_files
from robot_dyn.control.samples.table import TIME_NAMES, Table, name_of
from robot_dyn.foundations.errors import PlanError, shorten, shown
from robot_dyn.foundations.files import csv_rows
from robot_dyn.foundations.validate import in_order, numbers

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class DataFrame(Protocol):
    """A table of pandas or polars."""

    @property
    def columns(self) -> Iterable[object]:
        """Names of the columns."""
        ...

    def to_numpy(self) -> np.ndarray:
        """Return the values of the columns, one row for each row of the table."""
        ...


if TYPE_CHECKING:
    from robot_dyn.foundations.validate import JointValues

    Source = str | Path | JointValues | DataFrame

_MAX_BYTES = 2**28
_REMEDY = "give a CSV file in UTF-8 of at most 256 MiB, with columns t and the joints"
_BAG = "give the .mcap file in it, or a CSV file"


def table_of(
    source: Source, joint_names: tuple[str, ...], joints: Mapping[str, str], topic: str | None, time: ArrayLike | None
) -> Table:
    """Return the columns of a source; the columns of an array without headings are the joints.

    Raises:
        PlanError: If the source cannot be read, or has a column twice.
    """
    is_file = isinstance(source, str | Path)
    by_name = time is None or isinstance(time, str)
    if is_file and Path(source).suffix.lower() == SUFFIX:
        names = tuple(name for name in joints.values() if isinstance(name, str)) or joint_names
        return read_joint_states(source, names, topic, time)
    if topic is not None:
        raise PlanError(f"topic={shown(topic)} applies to MCAP logs only; remove it")
    if is_file:
        refuse_other_files(source, _BAG if Path(source).is_dir() else _REMEDY)
        times = TIME_NAMES if time is None else (time,) if isinstance(time, str) else ()
        names = {name for name in (*(joints.values() or joint_names), *times) if isinstance(name, str)}
        return Table(_of_csv(source, names, named_only=bool(joints)))
    if hasattr(source, "columns") and hasattr(source, "to_numpy"):
        columns = _of_frame(source, indexed=by_name)
    elif isinstance(source, Mapping):
        try:
            columns = {str(head): np.asarray(x) for head, x in source.items()}
        except Exception:  # a ragged list, or any error in the conversion of an object
            raise PlanError(f"samples: columns must be arrays of one length, got {shown(source)}") from None
    else:
        states = in_order("samples", source, joint_names, error=PlanError)
        rows = numbers("samples", states, ("m", len(joint_names)), error=PlanError)
        columns = dict(zip(joint_names, rows.T, strict=True))
    if by_name and time in TIMES and time not in columns:
        raise PlanError(f"time={time!r} applies to MCAP logs only; remove it")
    return Table(columns)


def _of_frame(frame: Any, *, indexed: bool) -> dict[str, np.ndarray]:
    """Return the columns of a data frame and, if `indexed`, its index if that has the name of a time."""
    heads = list(map(str, frame.columns))
    if twice := next((head for k, head in enumerate(heads) if head in heads[:k]), None):
        raise PlanError(f"samples: column {shorten(twice)!r} appears twice; keep one")
    columns = {head: _values(frame[name]) for head, name in zip(heads, frame.columns, strict=True)}
    index = getattr(frame, "index", None) if indexed else None  # only pandas has one
    name = getattr(index, "name", None)
    if name is not None and name_of(str(name)).lower() in TIME_NAMES and str(name) not in columns:
        columns = {str(name): _values(index), **columns}
    return columns


def _values(column: Any) -> np.ndarray:
    """Return a column as an array; stamps with a time zone, which to_numpy returns as objects, become UTC stamps."""
    if str(column.dtype).startswith("datetime64[ns, "):
        return column.to_numpy("datetime64[ns]")
    return column.to_numpy()


def _of_csv(path: str | Path, names: set[str], named_only: bool) -> dict[str, np.ndarray]:
    """Return the columns of a CSV file by heading; columns without numbers as empty texts.

    Args:
        path: The file.
        names: Names of joints and times, whose columns must be numbers.
        named_only: True if other columns are ignored.

    Raises:
        PlanError: If the file cannot be read, has no samples, or an entry of a named column, or of a column with
            numbers, is not a number; with file and line.
    """
    lines = csv_rows(path, _MAX_BYTES, PlanError, _REMEDY)
    _, heads = next(lines)
    if wrong := _wrong_headings(heads):
        raise PlanError(f"{path}: {wrong}")
    rows, odd = list[list[float | None]](), dict[int, tuple[str, str]]()  # the first text of each column
    for where, texts in lines:
        row = list(map(_number, texts))
        for k in (k for k, x in enumerate(row) if x is None and k not in odd) if None in row else ():
            odd[k] = where, texts[k]
        rows.append(row)
    if not rows:
        raise PlanError(f"{path}: has no samples below its first line; give at least 2")
    for k, (where, text) in odd.items():
        head, has_numbers = heads[k], any(row[k] is not None for row in rows)
        named = not names.isdisjoint((head, name_of(head), name_of(head).removeprefix("q ").strip()))
        named |= name_of(head).lower() in names.intersection(TIME_NAMES)
        if named or (has_numbers and not named_only):
            raise PlanError(f"{where}: column {shorten(head)!r}: {shorten(text)!r} is not a number; correct it")
    table = np.array(rows, dtype=float).T
    return {head: np.full(len(rows), "") if k in odd else table[k] for k, head in enumerate(heads)}


def _wrong_headings(heads: list[str]) -> str:
    """Return the fault of a first line that should name columns separated by commas; empty without a fault."""
    if not any(map(str.strip, heads)):
        return f"the file or its first line is empty; {_REMEDY}"
    if len(heads) == 1 and re.search(r"[;\t| ]", name_of(heads[0]).strip()):
        return (
            f"there is only one column, {shorten(heads[0])!r}; separate columns by commas and write decimal points, or"
            " pass the data frame of pandas.read_csv(path, sep=…, decimal=…)"
        )
    if None not in map(_number, heads):
        return f"the first line contains numbers, {shorten(', '.join(heads))}; name the columns there"
    twice = next((head for k, head in enumerate(heads) if head in heads[:k]), None)
    return "" if twice is None else f"column {shorten(twice)!r} appears twice; keep one"


def _number(text: str) -> float | None:
    """Return a text as a number; None if it is not one, or contains the underscores that Python allows."""
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None
