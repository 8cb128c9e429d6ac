"""The parts of figures of a batch: quantiles over time, outcomes, and a number per run, also over a parameter.

Bands show the runs that did not diverge; the others are drawn separately and counted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, final

import numpy as np

from robot_dyn.foundations.display import drawable
from robot_dyn.foundations.errors import QueryError, nearest, shown
from robot_dyn.queries.units import unit
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.simulation.results.samples import tracking_of
from robot_dyn.simulation.rollouts.rollouts_data import RolloutsData
from robot_dyn.simulation.run.outcome import Ending, Reason
from robot_dyn.view.plots.figure import LOST, TIME, Axes, Cell, Curve, Style
from robot_dyn.view.plots.pictures import PlotError
from robot_dyn.view.plots.sheet import Panel, in_rows

LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)
_MAX_LINES = 100  # drawn runs that diverged
_CELL_MM = 42.0  # minimum width of a cell


@final
@dataclass(frozen=True, eq=False)
class BatchView:
    """A batch, the columns of the shown joints, the columns of histogram and scatter, and the width in [mm]."""

    runs: RolloutsData
    joints: tuple[int, ...]
    x: str | None
    y: str | None
    width: float

    @property
    def lost(self) -> str:
        """Number of diverged runs, as the end of a heading; empty if there are none."""
        count = int(self.runs.diverged.sum())
        return f"; {count} of {len(self.runs)} diverged" if count else ""


@final
@dataclass(frozen=True, eq=False)
class Bars(Axes):
    """Counts between `edges`, and next to them `lost`, the diverged runs. Without edges each count is named."""

    counts: np.ndarray
    edges: np.ndarray | None = None
    names: tuple[str, ...] = ()
    lost: int = 0

    def fill(self, axes: Any, style: Style, diverged: bool) -> None:
        """Draw bars, with the counts of named bars and of diverged runs."""
        colours, paper = style.colours["lines"], style.colours["paper"]
        numbers = {"padding": 1, "fontsize": style.small - 0.5} | style.ink
        hues = [colours[LOST if name == Ending.DIVERGED.value else 0] for name in self.names] or colours[0]
        look = {"edgecolor": paper, "linewidth": 0.5, "label": "_counts"}
        if self.edges is None:
            at = np.arange(len(self.counts))
            bars = axes.bar(at, self.counts, 0.6, color=hues, **look)
            axes.set_xticks(at, [drawable(name) for name in self.names])
            axes.set_xlim(-0.6, max(len(at), 4) - 0.4)
            axes.bar_label(bars, **numbers)
        else:
            axes.bar(self.edges[:-1], self.counts, np.diff(self.edges), align="edge", color=hues, **look)
            if self.lost:
                width = np.ptp(self.edges)
                hatched = {"color": colours[LOST], "hatch": "///", "edgecolor": paper, "label": "_diverged"}
                bars = axes.bar([self.edges[-1] + 0.12 * width], [self.lost], 0.08 * width, **hatched)
                axes.bar_label(bars, [f"{self.lost} diverged"], **numbers)
        axes.set_ylim(0, 1.18 * max(1, *self.counts, self.lost))


def fan(view: BatchView) -> list[Panel]:
    """Return quantiles of q of each joint over time.

    Raises:
        PlotError: If q was not recorded.
    """
    if view.runs.q is None:
        raise PlotError('positions were not recorded; add "q" to record= of rollouts')
    kinds = joint_types(view.runs)
    names = [(view.runs.joint_names[i], f"q [{unit('q', kinds[i])}]") for i in view.joints]
    return [_fans(view, "Positions", names, view.runs.q[:, :, list(view.joints)])]


def tracking(view: BatchView) -> list[Panel]:
    """Return quantiles of the tracking error of each joint, or of the frame along each axis, over time.

    Raises:
        PlotError: If q was not recorded, or the runs have no reference, or come from a file.
    """
    runs = view.runs
    if runs.setup is None or runs.q is None:
        raise PlotError(
            "tracking: positions were not recorded, or the runs were read from a file; use the result of rd.rollouts,"
            " with q recorded"
        )
    found = tracking_of(runs.setup, runs.t, np.nan_to_num(runs.q))
    if found.tracking_error is None:
        raise PlotError("tracking: the runs followed no reference")
    off = np.where(np.isfinite(runs.q.sum(axis=2))[..., None], found.tracking_error, np.nan)
    if found.desired is None:
        return [_fans(view, "Tracking error", [(f"frame, {axis}", "p_d − p [m]") for axis in "xyz"], off)]
    kinds = joint_types(runs)
    names = [(runs.joint_names[i], f"q_d − q [{unit('q', kinds[i])}]") for i in view.joints]
    return [_fans(view, "Tracking error", names, off[:, :, list(view.joints)])]


def outcomes(view: BatchView) -> list[Panel]:
    """Return counts of runs that finished, ended by an event, diverged, or were stopped."""
    runs = view.runs
    by_event = np.array([outcome.reason is Reason.TERMINAL_EVENT for outcome in runs.ends])
    kinds = {"ended by an event": by_event, "diverged": runs.diverged, "stopped": runs.stopped}
    kinds = {"finished": ~np.any(list(kinds.values()), axis=0)} | kinds
    counts = {name: int(some.sum()) for name, some in kinds.items() if some.any()}
    bars = Bars("", "outcome", "runs [1]", np.array(list(counts.values())), names=tuple(counts))
    return [Panel("Outcomes", ((bars,),))]


def histogram(view: BatchView) -> list[Panel]:
    """Return the histogram of a number per run; by default the rms tracking error, otherwise the first extreme."""
    name, values = _column(view.runs, "y", view.y, ("rms tracking error", "largest", "ended"))
    some = np.isfinite(values) & ~view.runs.diverged
    if not some.any():
        raise PlotError(f"every run diverged or has no {name}")
    counts, edges = np.histogram(values[some], bins=min(30, max(5, int(np.sqrt(some.sum()) * 1.5))))
    bars = Bars(_title(view, some), name, "runs [1]", counts, edges, lost=int(view.runs.diverged.sum()))
    return [Panel(f"Histogram of {name}", ((bars,),), 47.0)]


def scatter(view: BatchView) -> list[Panel]:
    """Return a scatter of a number per run over a varied parameter, by default the first column that differs.

    Raises:
        PlotError: If nothing differs from run to run.
    """
    runs = view.runs
    varied = [name for name, x in runs.table().items() if name != "run" and _numeric(x) and np.ptp(x) > 0]
    if view.x is None and not (varied := [name for name in varied if name.startswith((*runs.varied, "start "))]):
        raise PlotError("scatter: no parameter or initial state varies between the runs; name a column by x=")
    x, at = _column(runs, "x", view.x or varied[0], ())
    y, values = _column(runs, "y", view.y, ("rms tracking error", "largest", "ended"))
    held = ~runs.diverged
    points = (Curve("run", at[held], values[held], dots=True),)
    cell = Cell(_title(view, np.isfinite(values) & held), x, y, points, lost=at[runs.diverged])
    return [Panel(f"{y} over {x}", ((cell,),), 63.0)]


BATCH_PLOTS: Mapping[str, Callable[[BatchView], list[Panel]]] = MappingProxyType(
    {f.__name__: f for f in (fan, tracking, outcomes, histogram, scatter)}
)


def _fans(view: BatchView, quantity: str, names: list[tuple[str, str]], values: np.ndarray) -> Panel:
    """Return a panel with the quantiles of each column of values (B, m, c)."""
    t, gone = view.runs.t, view.runs.diverged
    cells = []
    for k, (name, y) in enumerate(names):
        held, lost = values[~gone, :, k], values[gone, :, k]
        known = np.isfinite(held).any(axis=0)
        low, quarter, median, three_quarters, high = bands = np.full((len(LEVELS), len(t)), np.nan)
        if known.any():
            bands[:, known] = np.nanquantile(held[:, known], LEVELS, axis=0)
        lines = tuple(Curve("_diverged", t, line, (LOST, LOST), is_scaled=False) for line in lost[:_MAX_LINES])
        shades = (("25 to 75 %", quarter, three_quarters, 0.4), ("5 to 95 %", low, high, 0.18))
        ends = np.array([t[np.isfinite(line)][-1] for line in lost if np.isfinite(line).any()])
        cells.append(Cell(name, TIME, y, (Curve("median", t, median), *lines), bands=shades, lost=ends))
    rows = in_rows(cells, int(view.width / _CELL_MM))
    early = int(((view.runs.ended_s < t[-1]) & ~gone).sum())
    counted = f"; {early} ended early: bands include only runs still in progress" if early else ""
    many = f", {_MAX_LINES} of them drawn" if gone.sum() > _MAX_LINES else ""
    return Panel(f"{quantity} of {int((~gone).sum())} runs{view.lost}{many}{counted}", rows)


def _title(view: BatchView, some: np.ndarray) -> str:
    missing = int((~some & ~view.runs.diverged).sum())
    return f"{int(some.sum())} runs{view.lost}" + (f"; {missing} without this value" if missing else "")


def _column(runs: RolloutsData, option: str, name: str | None, preferred: tuple[str, ...]) -> tuple[str, np.ndarray]:
    """Return heading and numbers of a column of the table of runs, named with or without its unit.

    Raises:
        QueryError: If no column has that name, or it does not contain numbers.
    """
    table = {heading: x for heading, x in runs.table().items() if _numeric(x)}
    if name is None:
        name = next(heading for start in preferred for heading in table if heading.startswith(start))
    if not isinstance(name, str):
        raise QueryError(f"{option} must name a column of the table of runs, got {shown(name)}")
    for heading, x in table.items():
        if name in (heading, heading.partition(" [")[0]):
            return heading, x.astype(float)
    raise QueryError(f"{option}: no column {name!r}; {nearest(name, table)}")


def _numeric(x: np.ndarray) -> bool:
    return x.dtype.kind in "fiu"
