"""Base class of the results of studies: a sentence, tables, omitted parts, versions; in a notebook with a figure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import ClassVar

from robot_dyn.foundations.answer import Answer, Block
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.result import reported
from robot_dyn.report.save import drawn, write_result

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
        return write_result(self, path, theme)

    @property
    def drawing(self) -> str:
        from robot_dyn.foundations.display import inline

        try:
            return inline(drawn(self, "page")) if self.diagram else ""
        except RobotDynError:  # there is nothing to draw
            return ""
