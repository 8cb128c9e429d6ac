"""Layout of the figure of a result: a heading sentence, a caption, axes in a common style, and a legend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from robot_dyn.foundations.display import GRID, INK
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.view.plots.figure import THEMES, framed
from robot_dyn.view.plots.sheet import headed

if TYPE_CHECKING:
    from matplotlib.figure import SubFigure

_PART = 0.75  # fraction of the width, on the page of a notebook, which is narrower than paper
_PAD = 0.08  # [inch] around axes and texts

Colours = Mapping[str, Any]

PAGE: Colours = {"paper": "none", "ink": INK, "grid": GRID, "veil": "#80808022"} | {
    "lines": tuple(INK if colour == "#000000" else colour for colour in THEMES["light"]["lines"])
}
"""Colours for light and dark pages, with a transparent background."""


class ResultError(RobotDynError):
    """A result that cannot be written."""


def sheet(width: float, height: float, sentence: str, caption: str, theme: str) -> tuple[SubFigure, Colours]:
    """Create a figure, width × height in [inch], with a sentence and a caption as its heading.

    Return the part below the heading, and the colours. On the page of a notebook, which already shows the sentence,
    the figure has no heading and is narrower.
    """
    from robot_dyn.view.plots.shown import Figure

    on_page = theme == "page"
    colours = PAGE if on_page else THEMES[theme]
    size = (_PART if on_page else 1.0) * width, height
    figure = Figure(size, facecolor=colours["paper"])
    figure.set_layout_engine("constrained", w_pad=_PAD, h_pad=_PAD)
    body = figure.add_subfigure(figure.add_gridspec()[0])
    if not on_page:
        headed(figure, sentence, colours["ink"], fontsize=12, weight="bold")
        headed(body, caption, colours["ink"], fontsize=8.5)
    return body, colours


def programs(environment: Mapping[str, str], *names: str) -> str:
    """Return the versions of this library, Pinocchio and other programs, and the processor, for a caption."""
    versions = (f"{name} {environment[name]}" for name in ("robot-dyn", "pin", *names) if name in environment)
    return f"{', '.join(versions)}; {environment.get('processor', '')}"


def key(label: str, colour: str, **style: Any) -> Any:
    """Return an entry of a legend."""
    from matplotlib.lines import Line2D

    return Line2D([], [], color=colour, label=label, **style)


def styled(axes: Any, colours: Colours, x: str, title: str, y: str = "") -> None:
    """Give axes the colours of a theme, their title and labels."""
    framed(axes, colours, 8)
    axes.set_title(title, loc="left", fontsize=9, **ink(colours))
    axes.set_xlabel(x, fontsize=8.5, labelpad=1, **ink(colours))
    axes.set_ylabel(y, fontsize=8.5, **ink(colours))


def legend(figure: SubFigure, handles: Sequence[Any], colours: Colours, title: str = "") -> None:
    """Add a legend below a figure."""
    drawn = figure.legend(
        handles=handles, title=title, ncols=4, frameon=False, fontsize=8.5, loc="outside lower left", alignment="left"
    )
    drawn.get_title().set(color=colours["ink"], fontsize=8.5)
    for label in drawn.get_texts():
        label.set(**ink(colours))


def ink(colours: Colours) -> dict[str, Any]:
    """Return the properties of text: the colour of ink, and no mathtext."""
    return {"color": colours["ink"], "parse_math": False}
