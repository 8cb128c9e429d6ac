"""The layout of a figure: panels of cells one under the other on a sheet of a width, all lengths in [mm].

Text keeps its size at any width. Rows become lower, down to a least height, where the figure would be higher than A4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING, Any, final

from robot_dyn.foundations.display import drawable
from robot_dyn.view.plots.figure import Axes, Style, shortened

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH_MM, LEAST_MM, MOST_MM = 180.0, 80.0, 1000.0
A4_MM = 297.0
_INCH, _POINT = 25.4, 25.4 / 72
_EDGE, _LEFT, _RIGHT, _LABEL = 2.5, 15.5, 2.5, 11.9  # around all; beside the axes of a cell; from its label to its axes
_LINE, _LETTER = 1.35 * _POINT, 0.52 * _POINT  # height of a line, mean width of a letter, in sizes of the text in [pt]
_NUMBERS, _GAP = 7.5, 2.2  # below axes with and without numbers and the name of the x axis
_HANDLE = 4.2 * _POINT  # beside the text of an entry of a legend, in sizes of its text
_LEAST_ROW = 8.5
_CLEAR = 1.8  # above axes: the number of the highest tick is half above them
_MOST_REMARKS = 8  # lines above the panels; all are in the summary


@final
@dataclass(frozen=True)
class Panel:
    """Rows of cells under a heading; each row is `height` high, or less where the sheet is full.

    With `shared` the legend of the first cell is that of all, beside the heading; else each cell has its own.
    """

    heading: str
    rows: tuple[tuple[Axes, ...], ...]
    height: float = 24.0
    shared: bool = False


def draw(panels: list[Panel], opening: Sequence[tuple[str, str]], style: Style, width: float, diverged: bool) -> Figure:
    """The panels from top to bottom under the lines of the opening, each with its colour."""
    from robot_dyn.view.plots.shown import Figure

    lines = [(part, color) for text, color in opening for part in _wrapped(text, width - 2 * _EDGE, style.text)]
    lines = lines if style.titled else []
    if len(lines) > _MOST_REMARKS:
        lines = [*lines[: _MOST_REMARKS - 1], ("… the summary has all remarks", style.colours["ink"])]
    fixed = 2 * _EDGE + len(lines) * _LINE * style.text + sum(_fixed(panel, style, width) for panel in panels)
    rows = sum(len(panel.rows) * panel.height for panel in panels)
    least = max((_LEAST_ROW / panel.height for panel in panels), default=1.0)
    factor = min(1.0, max(least, (A4_MM - fixed) / rows))
    tall = fixed + factor * rows
    figure = Figure(figsize=(width / _INCH, tall / _INCH), facecolor=style.colours["paper"], dpi=120)
    y = tall - _EDGE
    for text, color in lines:
        y -= _LINE * style.text
        written = {"fontsize": style.text, "parse_math": False, "color": color}
        figure.text(_EDGE / width, (y + 0.8) / tall, drawable(text), **written)
    for panel in panels:
        y = _draw_panel(figure, panel, style, (width, tall), y, factor * panel.height, diverged)
    return figure


def _draw_panel(
    figure: Figure, panel: Panel, style: Style, size: tuple[float, float], y: float, height: float, diverged: bool
) -> float:
    """A panel whose top is at y; returns where it ends."""
    width, tall = size
    headings, entries = _heading(panel, style, width), panel.rows[0][0].labels if panel.shared else ()
    for k, text in enumerate(headings):
        at = _EDGE / width, (y - 1.2 - _LINE * style.heading * (k + 1) + 0.8) / tall
        figure.text(*at, drawable(text), fontsize=style.heading, weight="bold", **style.ink)
    y -= _above(panel, style, width)
    beside = y + 0.8 if entries else 0.0  # the bottom of the legend of all cells
    for cells in panel.rows:
        wide = (width - _EDGE) / len(cells)
        above = max(_title(cell, style, wide, panel.shared) for cell in cells)
        y -= above + height
        for k, cell in enumerate(cells):
            box = (wide * k + _LEFT) / width, y / tall
            axes = figure.add_axes((*box, (wide - _LEFT - _RIGHT) / width, height / tall))
            cell.fill(axes, style, diverged)
            axes.yaxis.set_label_coords(-_LABEL / (wide - _LEFT - _RIGHT), 0.5)  # one line, however long the numbers
            _titles(axes, cell, style, wide, height, panel.shared)
            if len(entries) > 1 and cells is panel.rows[0] and k == 0:
                _legend(figure, axes, style, (1 - _RIGHT / width, beside / tall), _across(entries, style, width))
        y -= _NUMBERS if cells[0].x else _GAP
    return y


def _titles(axes: Any, cell: Axes, style: Style, wide: float, height: float, shared: bool) -> None:
    """The title of a cell above its axes, and its legend at the right of it, or below it where there is no room."""
    inner, entries = wide - _LEFT - _RIGHT, () if shared else cell.labels
    lines = _entry_lines(cell, style, wide) if len(entries) > 1 else 0
    letters = int((wide - _RIGHT) / (_LETTER * style.text))
    title = drawable(shortened(cell.title, max(letters - len(cell.note), 8)) + cell.note)
    low = lines * _LINE * style.small + _CLEAR if lines and not _beside(cell, style, wide) else _CLEAR
    axes.set_title(
        title, loc="left", x=-(_LEFT - _EDGE) / inner, y=1 + low / height, pad=0, fontsize=style.text, **style.ink
    )
    if lines:
        _legend(axes, axes, style, (1.0, 1 + _CLEAR / height), _across(entries, style, inner))


def _legend(owner: Any, axes: Any, style: Style, corner: tuple[float, float], across: int) -> None:
    """A legend above that corner of the axes or figure."""
    handles, labels = axes.get_legend_handles_labels()
    legend = owner.legend(
        handles, labels, loc="lower right", bbox_to_anchor=corner, ncols=across, frameon=False, fontsize=style.small,
        borderpad=0, borderaxespad=0, handlelength=2.2, handletextpad=0.5, columnspacing=1.2, labelspacing=0.25,
    )  # fmt: skip
    for label in legend.get_texts():
        label.set(**style.ink)


def _fixed(panel: Panel, style: Style, width: float) -> float:
    """The height of a panel without that of its axes."""
    below = (_NUMBERS if cells[0].x else _GAP for cells in panel.rows)
    titles = (
        max(_title(cell, style, (width - _EDGE) / len(cells), panel.shared) for cell in cells) for cells in panel.rows
    )
    return _above(panel, style, width) + sum(below) + sum(titles)


def _above(panel: Panel, style: Style, width: float) -> float:
    """The height of a heading, and of the legend of all cells where it does not fit beside it."""
    headings, entries = _heading(panel, style, width), panel.rows[0][0].labels if panel.shared else ()
    lines = -(-len(entries) // _across(entries, style, width)) if len(entries) > 1 else 0
    fits = (
        headings
        and lines == 1
        and _wide(headings[-1], 1.2 * style.heading) + _entries(entries, style) < width - 2 * _EDGE
    )
    return (1.2 if headings else 0) + _LINE * (style.heading * len(headings) + style.small * (0 if fits else lines))


def _heading(panel: Panel, style: Style, width: float) -> list[str]:
    return _wrapped(panel.heading, width - 2 * _EDGE, 1.2 * style.heading) if style.titled and panel.heading else []


def _title(cell: Axes, style: Style, wide: float, shared: bool) -> float:
    """The room above axes for title and legend."""
    lines = _entry_lines(cell, style, wide) if len(cell.labels) > 1 and not shared else 0
    if lines and _beside(cell, style, wide):
        return _LINE * style.text + _CLEAR
    return (_LINE * style.text if cell.title or cell.note else 0) + lines * _LINE * style.small + _CLEAR


def _beside(cell: Axes, style: Style, wide: float) -> bool:
    """Whether title and legend of a cell fit on one line."""
    return _wide(cell.title + cell.note, style.text) + _entries(cell.labels, style) < wide - _RIGHT


def _entry_lines(cell: Axes, style: Style, wide: float) -> int:
    return -(-len(cell.labels) // _across(cell.labels, style, wide - _LEFT - _RIGHT))


def _across(labels: Sequence[str], style: Style, room: float) -> int:
    """How many entries of a legend stand beside each other."""
    if _entries(labels, style) < room:
        return len(labels)
    return max(1, min(len(labels) - 1, int(room / max(_entries([label], style) for label in labels))))


def _entries(labels: Sequence[str], style: Style) -> float:
    return sum(_wide(shortened(label, 30), style.small) + _HANDLE * style.small for label in labels)


def _wide(text: str, size: float) -> float:
    return len(text) * _LETTER * size


def _wrapped(text: str, room: float, size: float) -> list[str]:
    return wrap(text, max(int(room / (_LETTER * size)), 20), break_on_hyphens=False)
