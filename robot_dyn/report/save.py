"""The writer of results: a figure, a CSV table of the rows, or JSON, by the suffix."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from robot_dyn.foundations import files
from robot_dyn.foundations.result import json_text
from robot_dyn.foundations.validate import choice, instance
from robot_dyn.report.figure import ResultError
from robot_dyn.report.result import Result, drawn
from robot_dyn.view.plots.figure import THEMES
from robot_dyn.view.plots.plots import PICTURES

JSON = files.FileKind("a result", ".json", b'{\n "robot":')


def save_result(result: Result, path: str | Path, *, theme: str = "light") -> Path:
    """Write a result in the format of the suffix of `path`; without a suffix, in the first format it supports.

    PNG, SVG and PDF contain the figure and CSV the table of a certificate, of costs, of work and precision, of two
    runs or of a budget; JSON contains any result. An existing file is replaced only if it has the same kind.

    Args:
        result: A result of `certify`, `cost`, `stress`, `work_precision`, `diff_runs` or `budget`.
        path: Path of the file.
        theme: "light" or "dark" background.

    Raises:
        QueryError: If an argument is invalid.
        ResultError: If the file cannot be written, or there is nothing to draw.
    """
    instance(
        "result",
        result,
        Result,
        "give a result of rd.accuracy (certify, cost, work_precision), rd.diff_runs or a tool",
    )
    choice("theme", theme, THEMES)
    path = files.target(path, kinds(type(result)), ResultError)
    stream = io.BytesIO()
    if path.suffix.lower() == ".csv":
        stream.write(table(result).encode())
    elif path.suffix.lower() == JSON.suffix:
        stream.write(json_text(result).encode())
    else:
        drawn(result, theme).savefig(stream, format=path.suffix[1:].lower(), dpi=120)
    return files.save(path, lambda file: file.write(stream.getvalue()), ResultError)


def kinds(result_type: type[Result]) -> tuple[files.FileKind, ...]:
    """Return the kinds of file in which results of a class can be written."""
    tables = (table_kind(result_type),) if result_type.columns else ()
    return (*(PICTURES if result_type.diagram else ()), *tables, JSON)


def table_kind(result_type: type[Result]) -> files.FileKind:
    """Return the kind of the CSV table of a class of results."""
    return files.FileKind("a table of results", ".csv", ",".join(result_type.columns[:2]).encode())


def table(result: Result) -> str:
    """Return the rows of a result as CSV."""
    text = io.StringIO()
    writer = csv.DictWriter(text, result.columns, extrasaction="ignore")
    writer.writeheader()
    writer.writerows({key: files.table_cell(x) for key, x in row.items()} for row in result.rows)
    return text.getvalue()
