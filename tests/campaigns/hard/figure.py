"""The figure of the report: what was found over what is allowed, a mark for each figure and a line for each family."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from robot_dyn.report import styled
from robot_dyn.view.plots.figure import THEMES
from tests.campaigns.hard.case import Row

LEAST, MOST = 1e-6, 1e3  # what lies beyond is drawn at the edge
COLOURS = THEMES["light"]
LOOK = {  # verdict: colour of the theme, marker, what it is called
    "holds": (0, "o", "holds"),
    "said": (1, "D", "does not hold, and the library says so"),
    "SILENT": (3, "X", "wrong without a word"),
}


def draw(families: Mapping[str, Sequence[Row]]) -> Figure:
    """The figures of this library, by the title of their family."""
    figure = Figure((9.0, 0.42 * len(families) + 1.3), facecolor=COLOURS["paper"], layout="constrained")
    axes = figure.add_subplot()
    scatter = np.random.default_rng(0)  # marks beside each other, that they may be told apart
    for verdict, (number, marker, label) in LOOK.items():
        marks = [
            (_ratio(row), line + scatter.uniform(-0.28, 0.28))
            for line, rows in enumerate(families.values())
            for row in rows
            if row.ours and row.verdict == verdict
        ]
        if marks:
            x, y = zip(*marks, strict=True)
            colour = COLOURS["lines"][number]
            axes.scatter(x, y, s=14, c=colour, marker=marker, label=label, alpha=0.6, linewidths=0)
    axes.axvline(1.0, color=COLOURS["ink"], linewidth=1.0)
    axes.set_xscale("log")
    axes.set_xlim(LEAST / 2, MOST * 2)
    axes.set_yticks(range(len(families)), list(families))
    axes.invert_yaxis()
    edges = "at the left edge 1e-6 and less, at the right one 1e3 and more, or no answer"
    styled(axes, COLOURS, f"found / allowed; {edges}", "")
    axes.grid(visible=False, axis="y")
    figure.legend(loc="outside upper left", ncols=3, fontsize=8, frameon=False, labelcolor=COLOURS["ink"])
    return figure


def save(families: Mapping[str, Sequence[Row]], path: Path) -> None:
    """Write the figure, and the folder for it."""
    path.parent.mkdir(exist_ok=True)
    draw(families).savefig(path, dpi=120)


def _ratio(row: Row) -> float:
    """At the left edge what is 0 or bit-equal, at the right one what has no answer."""
    if math.isnan(row.found):
        return MOST
    if row.allowed <= 0:
        return LEAST if row.found <= 0 else MOST
    return float(np.clip(row.found / row.allowed, LEAST, MOST))
