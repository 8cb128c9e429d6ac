"""Results shown as lines and tables, alike in a terminal and a notebook, and stored as JSON."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from math import isfinite
from typing import final

from robot_dyn.foundations.errors import escaped


@final
@dataclass(frozen=True)
class Table:
    """A table of texts and numbers.

    Attributes:
        heading: Headings of the columns.
        rows: Cells, texts or numbers.
        digits: Significant digits of numbers.
        right: Headings of columns whose texts are right-aligned, like numbers.
        wrap: True if a narrow terminal breaks texts between words before it splits the table.
    """

    heading: tuple[str, ...]
    rows: tuple[tuple[str | float, ...], ...]
    digits: int = 6
    right: tuple[str, ...] = ()
    wrap: bool = False

    def __post_init__(self) -> None:
        for name in ("heading", "right"):  # names may come from files; a terminal would execute control characters
            object.__setattr__(self, name, tuple(map(escaped, getattr(self, name))))

    @property
    def words(self) -> tuple[str, ...]:
        """Headings of the left-aligned columns: those with texts, except those in `right`."""
        columns = zip(self.heading, zip(*self.rows, strict=True), strict=True) if self.rows else ()
        texts = (name for name, cells in columns if any(isinstance(cell, str) for cell in cells))
        return tuple(name for name in texts if name not in self.right)

    @property
    def cells(self) -> list[list[str]]:
        """The rows as texts of one line each."""
        return [
            [escaped(x) if isinstance(x, str) else number_or_dash(x, self.digits) for x in row] for row in self.rows
        ]

    @property
    def widths(self) -> list[int]:
        """Width of each column, in characters: its longest cell or heading."""
        return [max(map(len, column)) for column in zip(self.heading, *self.cells, strict=True)]

    @property
    def least_widths(self) -> list[int]:
        """Minimum width of each column, in characters: its longest cell, or its longest word if it may be wrapped."""
        columns = zip(self.heading, self.widths, zip(self.heading, *self.cells, strict=True), strict=True)
        return [
            max(len(word) for cell in column for word in cell.split() or [""])
            if self.wrap and name in self.words
            else widest
            for name, widest, column in columns
        ]

    @property
    def keys(self) -> int:
        """Number of leading columns that identify a row: text columns until no two rows are equal, at least 1."""
        cells = self.cells
        texts = [name in self.words for name in self.heading]
        for k in range(1, len(texts)):
            if not texts[k - 1]:
                break
            if len({tuple(row[:k]) for row in cells}) == len(cells):
                return k
        return 1

    def within(self, width: int) -> Iterator[Table]:
        """Yield parts of the table up to `width` characters wide, each with the columns that identify a row.

        A part with only one further column may be wider.
        """
        least, keys = self.least_widths, list(range(self.keys))
        parts = [[*keys]]
        for k in range(len(keys), len(least)):
            is_full = sum(least[j] + 2 for j in parts[-1]) + least[k] > width
            if is_full and len(parts[-1]) > len(keys):
                parts.append([*keys])
            parts[-1].append(k)
        for part in parts:
            rows = tuple(tuple(row[k] for k in part) for row in self.rows)
            yield replace(self, heading=tuple(self.heading[k] for k in part), rows=rows)

    def fitted(self, width: int) -> list[int]:
        """Return the width of each column in lines of `width` characters; columns of long texts share the rest."""
        fitted, widths = self.least_widths, self.widths
        spare = width - sum(fitted) - 2 * (len(fitted) - 1)
        open_columns = sorted(range(len(fitted)), key=lambda k: widths[k] - fitted[k])
        for place, k in enumerate(open_columns):
            more = max(0, min(widths[k] - fitted[k], spare // (len(fitted) - place)))
            fitted[k], spare = fitted[k] + more, spare - more
        return fitted

    @property
    def lines(self) -> Iterator[str]:
        """The table as lines of aligned columns."""
        words, widths = self.words, self.widths
        for row in [list(self.heading), *self.cells]:
            columns = zip(self.heading, row, widths, strict=True)
            yield "  ".join(x.ljust(w) if name in words else x.rjust(w) for name, x, w in columns).rstrip()


def number_or_dash(x: float, digits: int = 6) -> str:
    """Return a number as text, or a dash if it is infinite or not a number."""
    return f"{x:.{digits}g}" if isfinite(x) else "—"


Block = str | Table


class Answer:
    """A dataclass whose `repr` is its lines and tables, as the command line prints them; in a notebook it is HTML."""

    @property
    def title(self) -> str:
        """Heading in a notebook; if empty, the first line is used."""
        return ""

    @property
    def drawing(self) -> str:
        """A drawing, as SVG; empty if there is none."""
        return ""

    def blocks(self) -> Iterable[Block]:
        """Texts of one line each, and tables."""
        raise NotImplementedError

    def to_json(self) -> str:
        """The JSON document of docs/reference/json.md."""
        from robot_dyn.foundations.result import json_text  # late: the command line writes lines without NumPy

        return json_text(self)

    def __repr__(self) -> str:
        return "\n".join(line for block in self.blocks() for line in _lines(block))

    def _repr_html_(self) -> str:
        from robot_dyn.foundations import display

        first, *rest = self.blocks()
        parts = html_of([first, *rest] if self.title else rest)
        return display.page(self.title or "".join(_lines(first)), *parts, self.drawing)


def html_of(blocks: Iterable[Block]) -> Iterator[str]:
    """Yield texts and tables as HTML."""
    from robot_dyn.foundations import display

    for is_text, group in groupby(blocks, lambda block: isinstance(block, str)):
        if is_text:
            yield display.text("\n".join(line for block in group for line in _lines(block)).strip("\n"))
        else:
            yield from (
                display.grid(table.heading, table.cells, table.words) for table in group if isinstance(table, Table)
            )


def table(heading: Iterable[str], rows: Iterable[Iterable[str | float]], right: Iterable[str] = ()) -> str:
    """Return a table as HTML, with the same cells as its text."""
    return "".join(html_of([Table(tuple(heading), tuple(map(tuple, rows)), right=tuple(right))]))


def _lines(block: Block) -> Iterable[str]:
    return (escaped(block),) if isinstance(block, str) else block.lines
