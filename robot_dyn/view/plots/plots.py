"""Figures of a run or a batch: an overview on one page, or named parts."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from robot_dyn.description.description import check
from robot_dyn.description.edits import Edits
from robot_dyn.description.structure import structure_of
from robot_dyn.foundations.errors import DescriptionError, QueryError
from robot_dyn.foundations.errors import shown as text_of
from robot_dyn.foundations.validate import choice, instance, number, shaped
from robot_dyn.foundations.values import several
from robot_dyn.simulation.observation.remarks import remark_lines
from robot_dyn.simulation.results.run_data import TrajectoryData
from robot_dyn.simulation.rollouts.rollouts_data import RolloutsData
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.view.plots.batch import BATCH_PLOTS, BatchView
from robot_dyn.view.plots.figure import PAPER, THEMES, Style
from robot_dyn.view.plots.parts import PLOTS, View
from robot_dyn.view.plots.pictures import PlotError
from robot_dyn.view.plots.sheet import LEAST_MM, MOST_MM, WIDTH_MM, draw
from robot_dyn.view.series import effort_limits

if TYPE_CHECKING:
    from robot_dyn.view.plots.shown import Figure

MAX_JOINTS = 64  # largest number of joints in one figure
STYLES = ("screen", "paper")


def plot(
    run: TrajectoryData | RolloutsData,
    *names: str,
    only: Collection[str] | str | None = None,
    joints: Collection[str] | str | None = None,
    limits: np.ndarray | None = None,
    theme: Literal["light", "dark"] = "light",
    style: Literal["screen", "paper"] = "screen",
    width_mm: float = WIDTH_MM,
    x: str | None = None,
    y: str | None = None,
) -> Figure:
    """Return a figure of a run: an overview on one page, or the named parts, one below the other.

    The figure of a batch shows fans of quantiles, outcomes, and a histogram and a scatter of one number per run;
    parts that do not apply are omitted.

    The overview of up to 8 joints fits the height of A4 at any width. Text is 7 to 9 pt high.

    Args:
        run: A run with m samples of n joints, or rollouts.
        *names: overview, joints, torques, energy, tracking, phase, error_growth; for rollouts fan, tracking, outcomes,
            histogram, scatter.
        only: The same as *names.
        joints: Names of the joints to show; all by default.
        limits: Effort limits, shape (n,), in [N m] or [N], inf for none. By default, the limits that acted in the run;
            for joints without one, the limits of its URDF.
        theme: "light" or "dark", for screens.
        style: "paper" has thin lines, no title, and colours and dashes that differ in greyscale.
        width_mm: Width, in [mm], from 80 to 1000.
        x: For rollouts, the column of their table on the x axis of the scatter; by default the first varied parameter.
        y: For rollouts, the column shown by histogram and scatter, for example "largest u elbow_joint"; by default the
            tracking error.

    Raises:
        QueryError: If a part, a joint, a style or a theme is unknown, or the limits or the width are invalid.
        PlotError: If the run has no samples or too many joints, or lacks the data of a requested part.
    """
    instance("run", run, TrajectoryData | RolloutsData, "give a trajectory of rd.simulate, or rollouts")
    of_batch = isinstance(run, RolloutsData)
    parts = [*names, *_names("only", only, "parts")]
    known = BATCH_PLOTS if of_batch else PLOTS
    for name in parts:
        if isinstance(name, str) and name not in known and name in run.joint_names:
            raise QueryError(f"no plot {name!r}; it is a joint: give joints=[{name!r}]")
        choice("plot", name, known)
    shown = run.joint_names if joints is None else _names("joints", joints, "joints")
    for name in shown:
        choice("joint", name, run.joint_names)
    look, width = _style(theme, style), _width(width_mm)
    if isinstance(run, RolloutsData):
        if limits is not None:
            raise QueryError("limits= applies to a single run: plot(runs[0], limits=…)")
        return _of_batch(BatchView(run, _columns(run, shown), x, y, width), parts, look)
    if x is not None or y is not None:
        raise QueryError("x and y are columns of rollouts, but this is a single run; omit them")
    if not len(run.t):
        raise PlotError("nothing to draw: the run has no samples; simulate again")
    view = _view(run, shown, limits, width)
    with np.errstate(all="ignore"):  # the last samples of a run that diverged may overflow
        panels = [panel for name in parts or ("overview",) for panel in PLOTS[name](view)]
        end = run.outcome
        title = f"{run.metadata.get('robot', 'run')}: {end.ending} at t = {end.t:g} s, {run.statistics.method}"
        remarks = [text for text in (end.text, *remark_lines(run.remarks)) if text]
        return draw(panels, title, remarks, look, width, end.ending is Ending.DIVERGED)


def _of_batch(view: BatchView, parts: list[str], style: Style) -> Figure:
    """Draw parts of a batch, or all that apply."""
    panels = []
    with np.errstate(all="ignore"):
        for name in parts or BATCH_PLOTS:
            try:
                panels += BATCH_PLOTS[name](view)
            except PlotError:
                if parts:
                    raise
    first, *more = view.runs.summary.splitlines()
    title = f"{view.runs.metadata.get('robot', 'runs')}: {first}"
    return draw(panels, title, more[:-1], style, view.width, bool(view.runs.diverged.all()))


def _names(option: str, value: Any, kind: str) -> tuple[str, ...]:
    """Return names as a tuple, from one name or several."""
    if isinstance(value, str):
        return (value,)
    if (names := () if value is None else several(value)) is None:
        raise QueryError(f"{option}: give names of {kind}, got {text_of(value)}")
    return names


def _style(theme: str, style: str) -> Style:
    choice("theme", theme, THEMES)
    if choice("style", style, STYLES) == "screen":
        return Style(THEMES[theme])
    if theme != "light":
        raise QueryError("style='paper' is black on white; omit theme='dark'")
    return PAPER


def _width(width_mm: float) -> float:
    width = number("width_mm", width_mm, least=LEAST_MM)
    if width > MOST_MM:
        raise QueryError(f"width_mm must be at most {MOST_MM:g}, got {width:g}; it is in millimetres")
    return width


def _columns(run: TrajectoryData | RolloutsData, shown: Collection[str]) -> tuple[int, ...]:
    """Return the columns of the shown joints."""
    columns = tuple(i for i, name in enumerate(run.joint_names) if name in shown)
    if not 0 < len(columns) <= MAX_JOINTS:
        count = f"{len(columns)} joints, and one figure shows 1 to {MAX_JOINTS}"
        raise PlotError(f"{count}; select some, for example joints={list(run.joint_names[:2])}")
    return columns


def _view(run: TrajectoryData, shown: Collection[str], limits: np.ndarray | None, width: float) -> View:
    """Return the view of a run, with joint types and limits from its URDF; without a URDF, both units are named."""
    columns = _columns(run, shown)
    try:
        joints = structure_of(check(run.metadata.get("urdf", "").encode(), "the run's URDF"), Edits()).joints
    except DescriptionError:
        joints = {}
    known = [joints.get(name) for name in run.joint_names]
    stated, speeds = (
        np.array([np.inf if j is None else getattr(j, key) or np.inf for j in known]) for key in ("effort", "velocity")
    )
    limits = effort_limits(run, stated) if limits is None else limits
    efforts = shaped("limits", limits, run.joint_names).astype(float)
    if efforts.ndim != 1:
        raise QueryError(f"limits must have shape ({len(known)},), got {efforts.shape}")
    types = tuple(j and j.kind for j in known)
    return View(run, columns, types, _limits_or_inf(efforts), _limits_or_inf(speeds), width)


def _limits_or_inf(limits: np.ndarray) -> np.ndarray:
    """Return the limits, with inf for joints without one: 0, nan and 1e300 or more mean no limit."""
    return np.where((limits > 0) & (limits < 1e300), limits, np.inf)
