"""Two runs drawn: q of both over each other, and below it their difference with what they part beyond, by joint."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.accuracy.run_difference import RunDifference
from robot_dyn.foundations.display import drawable
from robot_dyn.queries.units import unit
from robot_dyn.report.figure import Colours, ResultError, key, legend, sheet, styled
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.view.plots.figure import shortened

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDE, _PAIR, _AROUND = 13.0, 3.6, 1.5  # [inch]: the sheet, a row of joints, heading and legend
_ACROSS, _MOST = 4, 64  # joints beside each other; that one figure shows
_LETTERS = 96  # of the names of a row of joints


def draw(result: RunDifference, theme: str = "light") -> Figure:
    """The figure.

    Raises:
        ResultError: If there are too many joints.
    """
    names = tuple(dict.fromkeys(each.joint for each in result.joints))
    if len(names) > _MOST:
        raise ResultError(f"a difference of {len(names)} joints cannot be drawn; a figure shows up to {_MOST}")
    across = 3 if len(names) in (5, 6, 9) else min(_ACROSS, len(names))
    rows = -(-len(names) // across)
    figure, colours = sheet(_WIDE, _PAIR * rows + _AROUND, result.sentence, _caption(result), theme)
    grid = figure.add_gridspec(rows, across)
    types = joint_types(result.runs[0])
    for i, name in enumerate(names):
        cell = grid[divmod(i, across)].subgridspec(2, 1, height_ratios=(1.3, 1))
        above = figure.add_subplot(cell[0])
        _over_each_other(above, result.runs, i, unit("q", types[i]), colours, shortened(name, _LETTERS // across))
        below = figure.add_subplot(cell[1], sharex=above)
        _difference(below, result, i, unit("q", types[i]), colours)
    a, b, _, grey = (colours["lines"][k] for k in (0, 1, 2, 3))
    handles = [
        key(drawable(result.names[0]), a),
        key(drawable(result.names[1]), b, linestyle="--"),
        key("b − a", colours["ink"]),
        key("± what they part beyond", grey, linestyle=":"),
    ]
    legend(figure, handles, colours)
    return figure.figure


def _caption(result: RunDifference) -> str:
    settings = "; ".join(f"{each.name}: {each.a} | {each.b}" for each in result.settings)
    text = f"Differs: {settings}." if settings else "No setting differs."
    return text if len(text) < 160 else f"{text[:150]}…"


def _over_each_other(axes: Any, runs: Any, i: int, of_q: str, colours: Colours, name: str) -> None:
    styled(axes, colours, "", drawable(name), f"q [{of_q}]")
    for run, colour, dashes in zip(runs, colours["lines"], ("-", "--"), strict=False):
        axes.plot(run.t, _finite(run.q[:, i]), dashes, color=colour, linewidth=1.3)
    axes.tick_params(labelbottom=False)


def _difference(axes: Any, result: RunDifference, i: int, of_q: str, colours: Colours) -> None:
    found = result.difference
    styled(axes, colours, "t [s]", "", f"b − a [{of_q}]")
    x = _finite(found.q[:, i])
    axes.plot(found.t, x, color=colours["ink"], linewidth=1.1)
    size = float(np.nanmax(np.abs(x))) if np.isfinite(x).any() else 0.0
    bound = np.where(found.bound <= 1.5 * size, found.bound, np.nan)  # a far bound must not flatten the curve
    for side in (1, -1):
        axes.plot(found.t, side * bound, ":", color=colours["lines"][3], linewidth=1)
    if result.parted is not None:
        axes.axvline(result.parted, color=colours["ink"], linewidth=0.6, linestyle=":")
    axes.ticklabel_format(axis="y", scilimits=(-3, 4))
    axes.yaxis.get_offset_text().set(color=colours["ink"], fontsize=7)


def _finite(x: np.ndarray) -> np.ndarray:
    return np.where(np.abs(x) < 1e300, x, np.nan)
