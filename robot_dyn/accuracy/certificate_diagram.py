"""The diagram of a certificate: digits over time, a panel for each quantity, from typical states to the worst found."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

from robot_dyn import files
from robot_dyn.accuracy.certificate import Certificate, Held
from robot_dyn.accuracy.diagram import DiagramError, styled, written
from robot_dyn.validate import instance
from robot_dyn.view.figure import THEMES, drawable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DIGITS = files.Kind("a table of digits", ".csv", b"quantity,road")
_COLUMNS = ("quantity", "road", "given", "typical", "samples", "random", "searched", "time_s", "repeats")
_WORDS = {"inverse_dynamics": "inverse dynamics", "forward_dynamics": "forward dynamics"}
_WIDTH, _HEIGHT, _SENTENCE = 15.0, 5.2, 150  # [inch], and letters of a line
_TOP = 21.0  # digits


def save_certificate(result: Certificate, path: str | Path, *, theme: str = "light") -> Path:
    """Write the diagram as PNG, SVG or PDF, or the digits as a CSV table, by the suffix of `path`; .png if it has none.

    Another file of that kind under that name is replaced; any other is not.

    Args:
        result: Of `certify`.
        path: Where to.
        theme: For "light" or "dark" paper.

    Raises:
        QueryError: If an argument is wrong.
        DiagramError: If it cannot be written, or there is nothing to draw.
    """
    instance("result", result, Certificate, "give that of rd.certify")
    return written(path, theme, DIGITS, lambda: table(result), lambda: draw(result, theme))


def table(result: Certificate) -> str:
    """The digits as CSV: a row for each quantity and road, and one for the decimals of the file."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(_COLUMNS)
    for each in result.held:
        writer.writerow([getattr(each, name) for name in _COLUMNS])
    for quantity, digits in result.decimals.items():
        writer.writerow([quantity, "decimals of the file as float64", "", "", "", "", digits, "", ""])
    return text.getvalue()


def draw(result: Certificate, theme: str = "light") -> Figure:
    """The diagram.

    Raises:
        DiagramError: If no digits were counted.
    """
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    colours = THEMES[theme]
    if not result.held:
        raise DiagramError("no digits were counted, so there is nothing to draw; look at left_out")
    ink = {"color": colours["ink"], "parse_math": False}
    figure = Figure(figsize=(_WIDTH, _HEIGHT), facecolor=colours["paper"])
    grid = figure.add_gridspec(1, len(result.quantities), left=0.04, right=0.99, top=0.76, bottom=0.2, wspace=0.16)
    said = fill(drawable(result.sentence), _SENTENCE)
    figure.text(0.012, 0.97, said, fontsize=12, weight="bold", va="top", **ink)
    figure.text(0.012, 0.865, drawable(_caption(result)), fontsize=8.5, va="top", **ink)
    for k, quantity in enumerate(result.quantities):
        axes = figure.add_subplot(grid[0, k])
        axes.set(xscale="log", ylim=(0, _TOP), yticks=range(0, 21, 5))
        styled(axes, colours, "time of a query [µs]", _WORDS.get(quantity, quantity))
        if not k:
            axes.set_ylabel("digits", fontsize=8.5, **ink)
        for each in result.held:
            if each.quantity == quantity:
                _mark(axes, each, colours["lines"][_hue(result, each.road, colours)], colours)
        axes.axhline(result.decimals[quantity], color=colours["ink"], linewidth=0.9, linestyle=(0, (6, 3)))
    handles = [
        Line2D(
            [], [], color=colours["lines"][_hue(result, road, colours)], marker="o", linewidth=3, label=drawable(road)
        )
        for road in result.roads
    ]
    handles.append(Line2D([], [], color=colours["ink"], linestyle="--", label="decimals of the file as float64"))
    style = {"ncols": 4, "frameon": False, "fontsize": 8.5, "loc": "lower left", "bbox_to_anchor": (0.03, 0.0)}
    legend = figure.legend(handles=handles, **style)
    for text in legend.get_texts():
        text.set_color(colours["ink"])
    return figure


def _caption(result: Certificate) -> str:
    """What is drawn."""
    samples = max(each.samples for each in result.held)
    return (
        f"{result.robot}: bars from the median of {samples} random states to the worst state found, a tick at the worst"
        f" random one; errors against balls of {result.bits} bits. κ of M up to {result.condition.searched:.3g}."
        f" {result.environment['processor']}."
    )


def _mark(axes: Any, each: Held, colour: str, colours: Mapping[str, Any]) -> None:
    """One road: the range of its digits at its time."""
    t = 1e6 * each.time_s
    axes.plot([t, t], [each.searched, each.typical], color=colour, linewidth=3, solid_capstyle="butt")
    axes.plot([t], [each.random], marker="_", color=colour, markersize=11, markeredgewidth=1.5)
    axes.plot([t], [each.searched], marker="o", color=colour, markersize=5)
    if each.given is not None:
        axes.plot([t], [each.given], marker="x", color=colours["ink"], markersize=6)


def _hue(result: Certificate, road: str, colours: Mapping[str, Any]) -> int:
    return result.roads.index(road) % len(colours["lines"])
