"""The layout of a figure: panels of cells one under the other, by Matplotlib's constrained layout.

Text keeps its size at any width. Rows become lower, down to a least height, where the figure would be higher than A4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import TYPE_CHECKING, Any, final

from robot_dyn.foundations.display import drawable
from robot_dyn.view.plots.figure import Axes, Style, shortened

if TYPE_CHECKING:
    from matplotlib.figure import Figure, FigureBase

WIDTH_MM, LEAST_MM, MOST_MM = 180.0, 80.0, 1000.0
A4_MM, MM = 297.0, 1 / 25.4
_HEADING, _TITLE, _NUMBERS = 10.0, 5.0, 8.0  # [mm]: about what they take above a panel, above and below a row
_BESIDE = 14.0  # [mm], about what numbers and the name of the y axis take
_LETTER, _LINE, _HANDLE = 0.19, 0.5, 1.5  # [mm], of 1 pt: width of a letter, a line, beside the text of a legend
_LEAST_ROW = 12.0  # [mm], with the room between rows
_MOST_REMARKS = 5  # letters of remarks above the panels, in a mm of the width; all are in the summary


@final
@dataclass(frozen=True)
class Panel:
    """Rows of cells under a heading; each row is about `height` mm high, or less where the page is full.

    With `shared` the legend of the first cell is that of all, below them; else each cell has its own.
    """

    heading: str
    rows: tuple[tuple[Axes, ...], ...]
    height: float = 24.0
    shared: bool = False

    def letters(self, width: float, text: float) -> int:
        """Number of letters of a size in pt in a line above a cell, in a figure of a width in [mm]."""
        return int((width / max(map(len, self.rows)) - _BESIDE) / (_LETTER * text))

    def tall(self, height: float, width: float, text: float) -> float:
        """About how high it is, in [mm], with rows of a height, in a figure of a width, with text of a size in pt."""
        letters = self.letters(width, text)
        lines = [max(_title(cell, letters).count("\n") for cell in row) for row in self.rows]
        rows = sum(_TITLE + height + _NUMBERS * bool(row[0].x) for row in self.rows)
        return _HEADING + rows + _LINE * text * sum(lines)


def in_rows(cells: Sequence[Axes], most: int) -> tuple[tuple[Axes, ...], ...]:
    """The cells in rows of `most` cells or fewer."""
    across = -(-len(cells) // -(-len(cells) // most))
    return tuple(tuple(cells[k : k + across]) for k in range(0, len(cells), across))


def draw(
    panels: list[Panel], opening: str, remarks: Sequence[str], style: Style, width: float, diverged: bool
) -> Figure:
    """The panels from top to bottom, under an opening and remarks in colour."""
    from robot_dyn.view.plots.shown import Figure

    told = "\n".join(remarks)
    if len(told) > _MOST_REMARKS * width:
        told = f"{told[: int(_MOST_REMARKS * width)]} … the summary has all remarks"
    lines = sum(1 + _LETTER * style.text * len(line) // width for line in f"{opening}\n{told}".split("\n"))
    above = lines * _LINE * style.text if style.titled else 0.0
    heights = [panel.tall(panel.height, width, style.text) for panel in panels]
    least = sum(panel.tall(_LEAST_ROW, width, style.text) for panel in panels)
    tall = max(above + least, min(A4_MM, above + sum(heights)))
    figure = Figure((width * MM, tall * MM), 120, facecolor=style.colours["paper"], layout="constrained")
    body = figure.add_subfigure(figure.add_gridspec()[0])
    if style.titled:
        headed(figure, opening, style.colours["ink"], fontsize=style.text)
        headed(body, told, style.colours["lines"][1], fontsize=style.text)
    parts = body.subfigures(len(panels), 1, squeeze=False, height_ratios=heights)[:, 0]
    for part, panel in zip(parts, panels, strict=True):
        _draw(part, panel, style, width, diverged)
    return figure


def headed(figure: FigureBase, text: str, colour: str, **font: Any) -> None:
    """A text above what a figure shows, in as many lines as its width takes."""
    if text:
        placed = {"x": 0.01, "ha": "left", "wrap": True}
        figure.suptitle(drawable(text), **placed, color=colour, parse_math=False, **font)


def _draw(part: Any, panel: Panel, style: Style, width: float, diverged: bool) -> None:
    """A panel in its part of the figure."""
    if style.titled:
        headed(part, panel.heading, style.colours["ink"], fontsize=style.heading, weight="bold")
    across = max(map(len, panel.rows))
    grid, letters = part.add_gridspec(len(panel.rows), across), panel.letters(width, style.text)
    room = width / across - _BESIDE
    for k, row in enumerate(panel.rows):
        for j, cell in enumerate(row):
            axes = part.add_subplot(grid[k, j])
            cell.fill(axes, style, diverged)
            lines = 0 if panel.shared else _legend(axes, axes, style, room, loc="lower left", bbox_to_anchor=(0, 1))
            pad = 4 + 1.35 * style.small * lines
            axes.set_title(drawable(_title(cell, letters)), loc="left", pad=pad, fontsize=style.text, **style.ink)
    if panel.shared:
        _legend(part, part.axes[0], style, width, loc="outside lower left")


def _title(cell: Axes, letters: int) -> str:
    """The title of a cell and its note, in lines of at most `letters` letters; a long name takes two."""
    name = shortened(cell.title, 2 * letters)
    if len(name) > letters:
        cut = max(name.rfind("_", 0, letters) + 1, len(name) - letters)
        name = f"{name[:cut]}\n{name[cut:]}"
    parts = [text for text in (name, fill(cell.note, letters)) if text]
    return (", " if len(", ".join(parts)) <= letters else "\n").join(parts)


def _legend(owner: Any, axes: Any, style: Style, room: float, **place: Any) -> int:
    """The legend of curves that have names, and how many lines it has; 0 if there is a single one."""
    handles, labels = axes.get_legend_handles_labels()
    if len(labels) < 2:
        return 0
    wide = (_LETTER * max(map(len, labels)) + _HANDLE) * style.small
    across = min(max(1, int(room / wide)), len(labels))
    legend = owner.legend(
        handles, labels, ncols=across, frameon=False, fontsize=style.small, borderpad=0, borderaxespad=0.5,
        handlelength=2.2, handletextpad=0.5, columnspacing=1.2, labelspacing=0.25, **place,
    )  # fmt: skip
    for label in legend.get_texts():
        label.set(**style.ink)
    return -(-len(labels) // across)
