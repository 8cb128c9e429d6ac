"""The one writer of results: a figure, a CSV table of the rows, or JSON, by the suffix."""

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
    """Write a result by the suffix of `path`, and by the first of these that it can be if there is none.

    PNG, SVG or PDF hold the figure and CSV the table of a certificate, of costs, of work and precision, of two runs
    or of a budget; JSON holds any result. Another file of that kind under that name is replaced; any other is not.

    Args:
        result: Of `certify`, `cost`, `stress`, `work_precision`, `compare_runs` or `budget`.
        path: Where to.
        theme: For "light" or "dark" paper.

    Raises:
        QueryError: If an argument is wrong.
        ResultError: If it cannot be written, or there is nothing to draw.
    """
    instance(
        "result",
        result,
        Result,
        "give one of rd.accuracy (certify, cost, work_precision), of rd.compare_runs, or of a tool",
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


def kinds(of: type[Result]) -> tuple[files.FileKind, ...]:
    """The files that a result of a class can be."""
    return (*(PICTURES if of.diagram else ()), *((table_kind(of),) if of.columns else ()), JSON)


def table_kind(of: type[Result]) -> files.FileKind:
    """The CSV table of a class of results."""
    return files.FileKind("a table of results", ".csv", ",".join(of.columns[:2]).encode())


def table(result: Result) -> str:
    """The rows of a result as CSV."""
    text = io.StringIO()
    writer = csv.DictWriter(text, result.columns, extrasaction="ignore")
    writer.writeheader()
    writer.writerows({key: files.table_cell(x) for key, x in row.items()} for row in result.rows)
    return text.getvalue()
