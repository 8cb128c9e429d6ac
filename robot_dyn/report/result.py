"""Base class of the results of studies: a sentence, tables, omitted parts, versions; in a notebook with a figure."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from robot_dyn.foundations import files
from robot_dyn.foundations.answer import Answer, Block
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.result import json_text, reported
from robot_dyn.foundations.validate import choice
from robot_dyn.report.figure import ResultError
from robot_dyn.view.plots.figure import THEMES
from robot_dyn.view.plots.pictures import PICTURES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

JSON = files.FileKind("a result", ".json", b'{\n "robot":')
INTERRUPTED = "the remaining parts, because of an interruption"


class Result(Answer):
    """A result of a study, a dataclass; `to_json` returns its JSON, and its rows form a CSV table.

    Attributes:
        columns: Columns of the table; missing values of a row are empty, other values of a row are omitted.
        diagram: Module whose function `draw(result, theme)` draws the result; empty without a figure.
        left_out: Omitted parts, with reasons.
        environment: Versions and processor.
    """

    columns: ClassVar[tuple[str, ...]] = ()
    diagram: ClassVar[str] = ""
    left_out: tuple[str, ...]
    environment: dict[str, str]

    @reported
    def interrupted(self) -> bool:
        """True if the user interrupted the study."""
        return INTERRUPTED in self.left_out

    @property
    def sentence(self) -> str:
        """The result in one sentence."""
        raise NotImplementedError

    @property
    def rows(self) -> Iterable[Mapping[str, object]]:
        """Rows of the table, values by column."""
        return ()

    def tables(self) -> Iterable[Block]:
        """Return the blocks between the sentence and the omitted parts."""
        raise NotImplementedError

    def blocks(self) -> Iterator[Block]:
        yield self.sentence
        yield ""
        yield from self.tables()
        yield from (f"left out: {part}" for part in self.left_out)
        yield ", ".join(f"{name} {value}" for name, value in self.environment.items())

    def save(self, path: str | Path, *, theme: str = "light") -> Path:
        """Save the result in the format of the suffix of `path`; without a suffix, in the first format it supports.

        PNG, SVG and PDF contain the figure and CSV the table of a certificate, of costs, of work and precision, of two
        runs or of a budget; JSON contains any result. An existing file is replaced only if it has the same format.

        Args:
            path: Path of the file.
            theme: "light" or "dark" background.

        Raises:
            QueryError: If `theme` is unknown.
            ResultError: If the suffix is unknown, the file cannot be written, or there is nothing to draw.
        """
        choice("theme", theme, THEMES)
        path = files.target(path, kinds(type(self)), ResultError)
        stream = io.BytesIO()
        if path.suffix.lower() == ".csv":
            stream.write(self._csv().encode())
        elif path.suffix.lower() == JSON.suffix:
            stream.write(json_text(self).encode())
        else:
            self._drawn(theme).savefig(stream, format=path.suffix[1:].lower(), dpi=120)
        return files.save(path, lambda file: file.write(stream.getvalue()), ResultError)

    def _csv(self) -> str:
        """Return the rows as CSV."""
        text = io.StringIO()
        writer = csv.DictWriter(text, self.columns, extrasaction="ignore")
        writer.writeheader()
        writer.writerows({key: files.table_cell(x) for key, x in row.items()} for row in self.rows)
        return text.getvalue()

    def _drawn(self, theme: str) -> Figure:
        """Draw the result; raise a ResultError if there is nothing to draw."""
        return import_module(self.diagram).draw(self, theme)

    @property
    def drawing(self) -> str:
        from robot_dyn.foundations.display import inline

        try:
            return inline(self._drawn("page")) if self.diagram else ""
        except RobotDynError:  # there is nothing to draw
            return ""


def kinds(result_type: type[Result]) -> tuple[files.FileKind, ...]:
    """Return the kinds of file in which results of a class can be written."""
    tables = (table_kind(result_type),) if result_type.columns else ()
    return (*(PICTURES if result_type.diagram else ()), *tables, JSON)


def table_kind(result_type: type[Result]) -> files.FileKind:
    """Return the kind of the CSV table of a class of results."""
    return files.FileKind("a table of results", ".csv", ",".join(result_type.columns[:2]).encode())
