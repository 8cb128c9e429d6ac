"""The sheet that a figure of a result is drawn on: its sentence, its caption, axes in one style, and a legend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

from robot_dyn.errors import RobotDynError
from robot_dyn.view.plots.figure import drawable, framed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LETTERS = 9.5  # of a heading, in an inch
_TOP, _LEFT, _LINE, _CAPTION = 0.15, 0.16, 0.22, 0.43  # [inch]: above and beside the heading, of its lines, below

Colours = Mapping[str, Any]


class ResultError(RobotDynError):
    """A result that cannot be written."""


def sheet(width: float, height: float, sentence: str, caption: str, colours: Colours) -> Figure:
    """A figure of that size in [inch], with its heading and a caption below it."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), facecolor=colours["paper"])
    said, left = fill(sentence, int(_LETTERS * width)), _LEFT / width
    below = _CAPTION + _LINE * said.count("\n")
    figure.text(left, 1 - _TOP / height, lines(said), fontsize=12, weight="bold", va="top", **ink(colours))
    figure.text(left, 1 - below / height, lines(caption), fontsize=8.5, va="top", linespacing=1.4, **ink(colours))
    return figure


def styled(axes: Any, colours: Colours, x: str, title: str, y: str = "") -> None:
    """Axes in the colours of a theme, with their title and labels."""
    framed(axes, colours, 8)
    axes.set_title(title, loc="left", fontsize=9, **ink(colours))
    axes.set_xlabel(x, fontsize=8.5, labelpad=1, **ink(colours))
    axes.set_ylabel(y, fontsize=8.5, **ink(colours))


def legend(figure: Figure, handles: Sequence[Any], colours: Colours, title: str = "") -> None:
    """What the marks of a figure are, at its lower left."""
    made = figure.legend(
        handles=handles, title=title, ncols=4, frameon=False, fontsize=8.5, loc="lower left",
        bbox_to_anchor=(0.03, 0.0), alignment="left",
    )  # fmt: skip
    made.get_title().set(color=colours["ink"], fontsize=8.5)
    for label in made.get_texts():
        label.set(color=colours["ink"], parse_math=False)


def ink(colours: Colours) -> dict[str, Any]:
    """How text is written."""
    return {"color": colours["ink"], "parse_math": False}


def lines(text: str) -> str:
    """Lines of which no sign is missing in the fonts of a figure."""
    return "\n".join(map(drawable, text.split("\n")))
