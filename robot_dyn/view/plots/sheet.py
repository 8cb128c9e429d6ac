"""The layout of a figure: panels of cells from top to bottom, by Matplotlib's constrained layout.

Text has the same size at any width. If the figure would exceed A4, rows are made lower, down to a minimum height.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import TYPE_CHECKING, Any, final

from robot_dyn.foundations.display import drawable
from robot_dyn.view.plots.figure import TIME, Axes, Style, framed, shortened

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

    from robot_dyn.view.plots.shown import Figure

WIDTH_MM, LEAST_MM, MOST_MM = 180.0, 80.0, 1000.0
A4_MM, MM = 297.0, 1 / 25.4
_HEADING, _BESIDE = 10.0, 14.0  # [mm]: approximate height of a heading with a legend, and width of the y axis of a cell
_LETTER, _LINE, _HANDLE = 0.19, 0.5, 1.5  # [mm] per pt: width of a letter, height of a line, width of a legend handle
_RIGHT = 1.5  # [mm], margin at the right for half of the last tick label
_MIN_ROW = 20.0  # [mm], with title and tick labels
_MAX_REMARKS = 5  # characters of remarks above the panels, per mm of the width; the summary has all remarks


@final
@dataclass(frozen=True)
class Panel:
    """Rows of cells under a heading, and below them one legend of the shared curves.

    Attributes:
        heading: Heading.
        rows: Cells from left to right.
        height: Approximate height of a row with title and tick labels, in [mm]; less if the page is full.
        every: Number of rows that share one x axis, below the last of them.
    """

    heading: str
    rows: tuple[tuple[Axes, ...], ...]
    height: float = 40.0
    every: int = 1

    def tall(self, height: float) -> float:
        """Return the approximate height of the sheet, in [mm], with rows of a given height."""
        return _HEADING + height * len(self.rows)


def in_rows(cells: Sequence[Axes], most: int) -> tuple[tuple[Axes, ...], ...]:
    """Return the cells in rows of `most` cells or fewer."""
    across = -(-len(cells) // -(-len(cells) // most))
    return tuple(tuple(cells[k : k + across]) for k in range(0, len(cells), across))


def draw(
    panels: list[Panel], opening: str, remarks: Sequence[str], style: Style, width: float, diverged: bool
) -> Figure:
    """Draw the panels from top to bottom, below a title and remarks in colour."""
    from robot_dyn.view.plots.shown import Figure

    told = "\n".join(remarks)
    if len(told) > _MAX_REMARKS * width:
        told = f"{told[: int(_MAX_REMARKS * width)].rpartition(' ')[0]} … see the summary for all remarks"
    lines = sum(1 + _LETTER * style.text * len(line) // width for line in f"{opening}\n{told}".split("\n"))
    above = lines * _LINE * style.text if style.titled else 0.0
    heights = [panel.tall(panel.height) for panel in panels]
    tall = max(above + sum(panel.tall(_MIN_ROW) for panel in panels), min(A4_MM, above + sum(heights)))
    figure = Figure((width * MM, tall * MM), 120, facecolor=style.colours["paper"])
    figure.set_layout_engine("constrained", rect=(0, 0, 1 - _RIGHT / width, 1))
    body = figure.add_subfigure(figure.add_gridspec()[0])
    if style.titled:
        headed(figure, opening, style.colours["ink"], fontsize=style.text)
        headed(body, told, style.colours["lines"][1], fontsize=style.text)
    parts = body.subfigures(len(panels), 1, squeeze=False, height_ratios=heights)[:, 0]
    for part, panel in zip(parts, panels, strict=True):
        _draw(part, panel, style, width, diverged)
    return figure


def headed(figure: FigureBase, text: str, colour: str, **font: Any) -> None:
    """Write a text above the contents of a figure, wrapped to its width."""
    if text:
        placed = {"x": 0.01, "ha": "left", "wrap": True}
        figure.suptitle(drawable(text), **placed, color=colour, parse_math=False, **font)


def _draw(part: Any, panel: Panel, style: Style, width: float, diverged: bool) -> None:
    """Draw a panel in its part of the figure."""
    if style.titled:
        headed(part, panel.heading, style.colours["ink"], fontsize=style.heading, weight="bold")
    across = max(map(len, panel.rows))
    grid, letters = part.add_gridspec(len(panel.rows), across), int((width / across - _BESIDE) / (_LETTER * style.text))
    entries = {}
    for k, row in enumerate(panel.rows):
        for j, cell in enumerate(row):
            axes = part.add_subplot(grid[k, j])
            framed(axes, style.colours, style.small - 0.5)
            cell.fill(axes, style, diverged)
            has_x = (k + 1) % panel.every == 0
            axes.tick_params(labelbottom=has_x, length=2, pad=2)
            side = "center" if cell.x == TIME else "left"  # the common factor of the tick labels is at the right
            axes.set_xlabel(drawable(cell.x) if has_x else "", labelpad=1, loc=side, fontsize=style.small, **style.ink)
            axes.set_ylabel(drawable(cell.y), fontsize=style.small, **style.ink)
            title = drawable(_title(cell, letters))
            handles, labels = axes.get_legend_handles_labels()
            curves = dict(zip(labels, handles, strict=True)) if len(labels) > 1 else {}
            if cell.own_legend and curves:
                above = {"loc": "lower left", "bbox_to_anchor": (0, 1), "title": title, "alignment": "left"}
                _legend(axes, curves, style, width / across - _BESIDE, borderaxespad=0, **above)
            else:
                axes.set_title(title, loc="left", pad=4, fontsize=style.text, **style.ink)
                entries |= curves
    if entries:
        _legend(part, entries, style, width, loc="outside lower left", borderaxespad=0.5)
    part.align_ylabels()


def _title(cell: Axes, letters: int) -> str:
    """Return the title of a cell and its note, wrapped to `letters` characters; long names break after "_"."""
    parts = [text for text in (shortened(cell.title, 2 * letters), cell.note) if text]
    in_one = ", ".join(parts)
    return (
        in_one
        if len(in_one) <= letters
        else "\n".join(fill(text.replace("_", "_ "), letters).replace("_ ", "_") for text in parts)
    )


def _legend(where: Any, entries: dict[str, Any], style: Style, width: float, **placed: Any) -> None:
    """Add a legend to axes or to a part of a figure, in as many columns as fit."""
    wide = (_LETTER * max(map(len, entries)) + _HANDLE) * style.small
    legend = where.legend(
        entries.values(), entries.keys(), ncols=min(max(1, int(width / wide)), len(entries)), frameon=False,
        fontsize=style.small, title_fontsize=style.text, borderpad=0, handlelength=2.2,
        handletextpad=0.5, columnspacing=1.2, labelspacing=0.25, **placed,
    )  # fmt: skip
    for label in [legend.get_title(), *legend.get_texts()]:
        label.set(**style.ink)
