"""CSV files of numbers: the first line names the columns, commas separate them, decimals have a point."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from robot_dyn.foundations.errors import PlanError, shorten
from robot_dyn.foundations.files import read

_MOST_BYTES = 2**28
_REMEDY = "give a CSV file in UTF-8 of at most 256 MiB, with columns t and the joints"
_OTHER = {";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces"}


def read_csv(path: str | Path) -> dict[str, np.ndarray]:
    """The columns of a CSV file by heading.

    Raises:
        PlanError: If it cannot be read, has no samples, or an entry is not a number; it names file and line.
    """
    data = read(path, _MOST_BYTES, PlanError, _REMEDY)
    try:
        lines = csv.reader(data.decode("utf-8-sig").splitlines(), strict=True)
        headings = next(lines, [])
        rows = [(lines.line_num, line) for line in lines if line]
    except (UnicodeDecodeError, csv.Error) as error:
        raise PlanError(f"{path}: is not a CSV file in UTF-8 ({error}); write it again") from None
    _check(path, headings, rows)
    try:
        table = np.array([list(map(_number, line)) for _, line in rows]).reshape(-1, len(headings))
    except ValueError:  # no number, or a ragged list
        raise PlanError(f"{path}: {_wrong(headings, rows)}; correct it") from None
    return dict(zip(headings, table.T, strict=True))


def _check(path: str | Path, headings: list[str], rows: list[tuple[int, list[str]]]) -> None:
    """Raise PlanError if the first line does not name columns that commas separate, or nothing follows it."""
    if not any(map(str.strip, headings)):
        raise PlanError(f"{path}: is empty, or its first line is; {_REMEDY}")
    if len(headings) == 1:
        for mark, name in _OTHER.items():
            if mark in headings[0].strip():
                raise PlanError(
                    f"{path}: {name} separate its columns; write it with commas and decimal points, or give the data"
                    f" frame of pandas.read_csv(path, sep={mark!r}), with decimal=',' where decimals have a comma"
                )
    if all(_is_number(each) for each in headings):
        raise PlanError(f"{path}: its first line holds numbers, {shorten(', '.join(headings))}; name the columns there")
    if twice := next((each for k, each in enumerate(headings) if each in headings[:k]), None):
        raise PlanError(f"{path}: column {shorten(twice)!r} is there twice; keep one")
    if not rows:
        raise PlanError(f"{path}: has no samples below its first line")


def _number(text: str) -> float:
    """As float(), without the underscores that Python allows."""
    if "_" in text:
        raise ValueError
    return float(text)


def _is_number(text: str) -> bool:
    try:
        _number(text)
    except ValueError:
        return False
    return True


def _wrong(headings: list[str], rows: list[tuple[int, list[str]]]) -> str:
    """The first line that is not a number for each column."""
    for number, line in rows:
        if len(line) != len(headings):
            return f"line {number} has {len(line)} entries for {len(headings)} columns"
        for heading, text in zip(headings, line, strict=True):
            if not _is_number(text):
                return f"line {number}: column {shorten(heading)!r} holds {shorten(text)!r}, not a number"
    return "its lines have different numbers of entries"
