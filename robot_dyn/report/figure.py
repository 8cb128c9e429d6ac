"""The layout of a figure of a result: its sentence, its caption, axes in one style, and a legend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

from robot_dyn.foundations.display import GRID, INK, drawable
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.view.plots.figure import THEMES, framed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LETTERS = 9.5  # of a heading, in an inch
_PART = 0.75  # of the width, on a page, which is narrower than paper
_TOP, _LEFT, _LINE, _CAPTION = 0.15, 0.16, 0.22, 0.43  # [inch]: above and beside the heading, of its lines, below

Colours = Mapping[str, Any]

PAGE: Colours = {"paper": "none", "ink": INK, "grid": GRID, "veil": "#80808022"} | {
    "lines": tuple(INK if each == "#000000" else each for each in THEMES["light"]["lines"])
}
"""Colours for light and dark pages, without paper."""


class ResultError(RobotDynError):
    """A result that cannot be written."""


def sheet(width: float, height: float, sentence: str, caption: str, theme: str) -> tuple[Figure, Colours]:
    """Return a figure of a size in [inch], headed by a sentence and a caption, and its colours.

    For the page of a notebook, which has the sentence beside it, there is no heading.
    """
    from robot_dyn.view.plots.shown import Figure

    if theme == "page":
        return Figure(figsize=(_PART * width, height), facecolor=PAGE["paper"]), PAGE
    colours = THEMES[theme]
    figure = Figure(figsize=(width, height), facecolor=colours["paper"])
    heading, left = _heading(sentence, width), _LEFT / width
    below = _CAPTION + _LINE * heading.count("\n")
    figure.text(left, 1 - _TOP / height, lines(heading), fontsize=12, weight="bold", va="top", **ink(colours))
    figure.text(left, 1 - below / height, lines(caption), fontsize=8.5, va="top", linespacing=1.4, **ink(colours))
    return figure, colours


def heading_room(width: float, sentence: str, theme: str) -> float:
    """Return the height in [inch] of the lines of a heading after its first one; 0 on a page, which has none."""
    return 0.0 if theme == "page" else _LINE * _heading(sentence, width).count("\n")


def _heading(sentence: str, width: float) -> str:
    return fill(sentence, int(_LETTERS * width))


def programs(environment: Mapping[str, str], *names: str) -> str:
    """Return the versions of this library, Pinocchio and other programs, and the processor, for a caption."""
    known = (f"{name} {environment[name]}" for name in ("robot-dyn", "pin", *names) if name in environment)
    return f"{', '.join(known)}; {environment.get('processor', '')}"


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


def legend(figure: Figure, handles: Sequence[Any], colours: Colours, title: str = "") -> None:
    """Explain the marks of a figure at its lower left."""
    drawn = figure.legend(
        handles=handles, title=title, ncols=4, frameon=False, fontsize=8.5, loc="lower left",
        bbox_to_anchor=(0.03, 0.0), alignment="left",
    )  # fmt: skip
    drawn.get_title().set(color=colours["ink"], fontsize=8.5)
    for label in drawn.get_texts():
        label.set(color=colours["ink"], parse_math=False)


def ink(colours: Colours) -> dict[str, Any]:
    """Return how text is written."""
    return {"color": colours["ink"], "parse_math": False}


def lines(text: str) -> str:
    """Return lines with what the fonts of a figure lack spelled out."""
    return "\n".join(map(drawable, text.split("\n")))
