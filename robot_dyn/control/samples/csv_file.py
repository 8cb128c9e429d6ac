"""CSV files of numbers: the first line names the columns, commas separate them, decimals have a point."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from robot_dyn.control.samples.table import name_of
from robot_dyn.foundations.errors import PlanError, shorten
from robot_dyn.foundations.files import csv_rows

_MOST_BYTES = 2**28
_REMEDY = "give a CSV file in UTF-8 of at most 256 MiB, with columns t and the joints"


def read_csv(path: str | Path) -> dict[str, np.ndarray]:
    """Return the columns of a CSV file by heading.

    Raises:
        PlanError: If it cannot be read, has no samples, or an entry is not a number; it names file and line.
    """
    lines, rows = csv_rows(path, _MOST_BYTES, PlanError, _REMEDY), list[list[float | None]]()
    _, heads = next(lines)
    if wrong := _wrong_headings(heads):
        raise PlanError(f"{path}: {wrong}")
    for where, texts in lines:
        row = list(map(_number, texts))
        if None in row:
            k = row.index(None)
            what = f"column {shorten(heads[k])!r} holds {shorten(texts[k])!r}"
            raise PlanError(f"{where}: {what}, not a number; correct it")
        rows.append(row)
    if not rows:
        raise PlanError(f"{path}: has no samples below its first line")
    return dict(zip(heads, np.array(rows, float).T, strict=True))


def _wrong_headings(heads: list[str]) -> str:
    """Return why a first line does not name columns that commas separate; empty if it does."""
    if not any(map(str.strip, heads)):
        return f"is empty, or its first line is; {_REMEDY}"
    if len(heads) == 1 and re.search(r"[;\t| ]", name_of(heads[0]).strip()):
        return (
            f"has one column, {shorten(heads[0])!r}; separate columns by commas and write decimal points, or give"
            " the data frame of pandas.read_csv(path, sep=…, decimal=…)"
        )
    if None not in map(_number, heads):
        return f"its first line holds numbers, {shorten(', '.join(heads))}; name the columns there"
    twice = next((head for k, head in enumerate(heads) if head in heads[:k]), None)
    return "" if twice is None else f"column {shorten(twice)!r} is there twice; keep one"


def _number(text: str) -> float | None:
    """Return the number that a text states, without the underscores that Python allows; None if it states none."""
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None
