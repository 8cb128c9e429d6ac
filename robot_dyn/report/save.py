"""Save a result in the format of a suffix: a figure, a CSV table of its rows, or JSON."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Protocol

from robot_dyn.foundations import files
from robot_dyn.foundations.result import json_text
from robot_dyn.foundations.validate import choice
from robot_dyn.report.figure import ResultError
from robot_dyn.view.plots.figure import THEMES
from robot_dyn.view.plots.pictures import PICTURES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

JSON = files.FileKind("a result", ".json", b'{\n "robot":')


class Saved(Protocol):
    """The parts of a `Result` that its files contain; `Result` describes them."""

    columns: ClassVar[tuple[str, ...]]
    diagram: ClassVar[str]

    @property
    def rows(self) -> Iterable[Mapping[str, object]]:
        """Rows of the table."""
        ...


def write_result(result: Saved, path: str | Path, theme: str) -> Path:
    """Save a result; see `Result.save`."""
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


def kinds(result_type: type[Saved]) -> tuple[files.FileKind, ...]:
    """Return the kinds of file in which results of a class can be written."""
    tables = (table_kind(result_type),) if result_type.columns else ()
    return (*(PICTURES if result_type.diagram else ()), *tables, JSON)


def table_kind(result_type: type[Saved]) -> files.FileKind:
    """Return the kind of the CSV table of a class of results."""
    return files.FileKind("a table of results", ".csv", ",".join(result_type.columns[:2]).encode())


def table(result: Saved) -> str:
    """Return the rows of a result as CSV."""
    text = io.StringIO()
    writer = csv.DictWriter(text, result.columns, extrasaction="ignore")
    writer.writeheader()
    writer.writerows({key: files.table_cell(x) for key, x in row.items()} for row in result.rows)
    return text.getvalue()


def drawn(result: Saved, theme: str = "light") -> Figure:
    """Draw a result by the module in `diagram`.

    Raises:
        ResultError: If there is nothing to draw.
    """
    return import_module(result.diagram).draw(result, theme)
