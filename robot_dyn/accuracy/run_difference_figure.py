"""Figure of two runs: by joint, q of both runs, and below it their difference with the threshold of parting."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from robot_dyn.accuracy.run_difference import RunDifference
from robot_dyn.foundations.display import drawable
from robot_dyn.queries.units import unit
from robot_dyn.report.figure import Colours, ResultError, key, legend, sheet, styled
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.simulation.results.run_data import TrajectoryData
from robot_dyn.view.plots.figure import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH, _ROW_HEIGHT, _MARGIN = 13.0, 3.6, 1.5  # [inch]: the sheet, a row of joints, heading and legend
_MAX_COLUMNS, _MAX_JOINTS = 4, 64  # largest numbers of columns and joints in one figure
_LETTERS = 96  # in the names of a row of joints


def draw(result: RunDifference, theme: str = "light") -> Figure:
    """Draw the figure.

    Raises:
        ResultError: If the runs have more than 64 joints.
    """
    names = tuple(dict.fromkeys(row.joint for row in result.joints))
    if len(names) > _MAX_JOINTS:
        raise ResultError(f"a difference of {len(names)} joints cannot be drawn; a figure shows up to {_MAX_JOINTS}")
    columns = 3 if len(names) in (5, 6, 9) else min(_MAX_COLUMNS, len(names))
    rows = -(-len(names) // columns)
    figure, colours = sheet(_WIDTH, _ROW_HEIGHT * rows + _MARGIN, result.sentence, _caption(result), theme)
    grid = figure.add_gridspec(rows, columns)
    types = joint_types(result.runs[0])
    for i, name in enumerate(names):
        cell = grid[divmod(i, columns)].subgridspec(2, 1, height_ratios=(1.3, 1))
        above = figure.add_subplot(cell[0])
        _draw_runs(above, result.runs, i, unit("q", types[i]), colours, shortened(name, _LETTERS // columns))
        below = figure.add_subplot(cell[1], sharex=above)
        _draw_difference(below, result, i, unit("q", types[i]), colours)
    a, b, _, grey = (colours["lines"][k] for k in (0, 1, 2, 3))
    handles = [
        key(drawable(result.names[0]), a),
        key(drawable(result.names[1]), b, linestyle="--"),
        key("b − a", colours["ink"]),
        key("± threshold of parting", grey, linestyle=":"),
    ]
    legend(figure, handles, colours)
    return figure.figure


def _caption(result: RunDifference) -> str:
    settings = "; ".join(f"{setting.name}: {setting.a} | {setting.b}" for setting in result.settings)
    text = f"Differs: {settings}." if settings else "No setting differs."
    return text if len(text) < 160 else f"{text[:150]}…"


def _draw_runs(axes: Axes, runs: Iterable[TrajectoryData], i: int, unit_of_q: str, colours: Colours, name: str) -> None:
    styled(axes, colours, "", drawable(name), f"q [{unit_of_q}]")
    for run, colour, dashes in zip(runs, colours["lines"], ("-", "--"), strict=False):
        axes.plot(run.t, _finite(run.q[:, i]), dashes, color=colour, linewidth=1.3)
    axes.tick_params(labelbottom=False)


def _draw_difference(axes: Axes, result: RunDifference, i: int, unit_of_q: str, colours: Colours) -> None:
    difference = result.difference
    styled(axes, colours, "t [s]", "", f"b − a [{unit_of_q}]")
    x = _finite(difference.q[:, i])
    axes.plot(difference.t, x, color=colours["ink"], linewidth=1.1)
    size = float(np.nanmax(np.abs(x))) if np.isfinite(x).any() else 0.0
    bound = np.where(difference.bound <= 1.5 * size, difference.bound, np.nan)  # a far bound would flatten the curve
    for side in (1, -1):
        axes.plot(difference.t, side * bound, ":", color=colours["lines"][3], linewidth=1)
    if result.parted_s is not None:
        axes.axvline(result.parted_s, color=colours["ink"], linewidth=0.6, linestyle=":")
    axes.ticklabel_format(axis="y", scilimits=(-3, 4))
    axes.yaxis.get_offset_text().set(color=colours["ink"], fontsize=7)


def _finite(x: np.ndarray) -> np.ndarray:
    """Return x with nan where it is not finite or too large to draw."""
    return np.where(np.abs(x) < 1e300, x, np.nan)
