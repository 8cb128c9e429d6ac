"""Base class of the results of studies: a sentence, tables, omitted parts, versions; in a notebook with a figure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, ClassVar

from robot_dyn.foundations.answer import Answer, Block
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.result import reported

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
        """Return True if the user interrupted the study."""
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

    @property
    def drawing(self) -> str:
        from robot_dyn.foundations.display import inline

        try:
            return inline(drawn(self, "page")) if self.diagram else ""
        except RobotDynError:  # there is nothing to draw
            return ""


def drawn(result: Result, theme: str = "light") -> Figure:
    """Draw a result by the module in `diagram`.

    Raises:
        ResultError: If there is nothing to draw.
    """
    return import_module(result.diagram).draw(result, theme)
