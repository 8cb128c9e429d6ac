"""A table as CSV, written in blocks of rows: the names and units are its first line."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from typing import Any, BinaryIO

import numpy as np

from robot_dyn.foundations.files import table_cell
from robot_dyn.simulation.columns import Column, by_heading

_ROWS = 4096  # of a block: as Python's numbers they take ten times the memory of arrays


def write(_: object, columns: Iterable[Column], stream: BinaryIO) -> None:
    """Write `run.table()`; numbers as `repr` writes them, which float() returns."""
    table = by_heading(columns)
    values = list(table.values())
    text = io.TextIOWrapper(stream, encoding="utf-8", newline="")
    lines = csv.writer(text)
    lines.writerow(map(table_cell, table))
    for start in range(0, len(values[0]), _ROWS):
        lines.writerows(zip(*(_cells(column[start : start + _ROWS]) for column in values), strict=True))
    text.detach()


def _cells(column: np.ndarray) -> list[Any]:
    cells = column.tolist()
    return cells if column.dtype.kind in "fiub" else [table_cell(cell) for cell in cells]
