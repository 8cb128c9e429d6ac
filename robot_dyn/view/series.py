"""Series: the columns of runs that the page plots: q, v, u and the ledger, E(t) − E(0) = Σ W_k + residual.

Long runs are thinned: of each bucket of samples the least and the largest of each column stay, so no peak is lost.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.queries.units import unit
from robot_dyn.simulation.results.trajectory import Trajectory

if TYPE_CHECKING:
    from robot_dyn.view.stage import Stage

_BUCKETS = 500  # a plot is about as wide in pixels
_MOST = 1e38  # of single precision


def plots(runs: list[Trajectory], stages: list[Stage]) -> list[dict[str, Any]]:
    """Return title, unit, times and series of each plot; a series has one colour in the run and its ghosts."""
    types = {"revolute" if body.revolute else "prismatic" for stage in stages for body in stage.linkage.bodies}
    kind = types.pop() if len(types) == 1 else None
    titles = (
        ("joint positions q", unit("q", kind)),
        ("joint velocities v", unit("v", kind)),
        ("actuation u", unit("u", kind)),
        ("energy ledger", "J"),
    )
    columns = [_columns(run) for run in runs]
    return [
        {"title": title, "unit": unit} | _joined(runs, [each[index] for each in columns])
        for index, (title, unit) in enumerate(titles)
    ]


def _columns(run: Trajectory) -> list[dict[str, np.ndarray]]:
    names, ledger, m = run.joint_names, run.ledger, len(run.t)
    energy = {
        "K": ledger.kinetic,
        "V − V(0)": ledger.potential - ledger.potential[0],
        "E − E(0)": ledger.energy - ledger.energy[0],
    }
    energy |= {f"W {name}": work for name, work in ledger.work.items()} | {"residual": ledger.residual}
    by_joint = [dict(zip(names, each.T, strict=True)) for each in (run.q, run.v, run.u)]
    return [*by_joint, {name: column[:m] for name, column in energy.items()}]


def _joined(runs: list[Trajectory], columns: list[dict[str, np.ndarray]]) -> dict[str, Any]:
    """The series of all runs at the times that thinning keeps of any of them; nan where a run has ended."""
    times = [run.t[thinned(np.stack(list(each.values()), axis=1))] for run, each in zip(runs, columns, strict=True)]
    t = np.unique(np.concatenate(times))
    colors = {name: index for index, name in enumerate(dict.fromkeys(name for each in columns for name in each))}
    series = []
    for number, (run, each) in enumerate(zip(runs, columns, strict=True)):
        for name, values in each.items():
            drawn = np.interp(t, run.t, np.clip(values, -_MOST, _MOST), right=np.nan).astype(np.float32)
            series.append(
                {
                    "label": name + ghost_mark(number, len(runs)),
                    "values": drawn,
                    "color": colors[name],
                    "ghost": number > 0,
                }
            )
    return {"t": t, "series": series}


def ghost_mark(number: int, count: int) -> str:
    """Return what follows the name of the run of that number, from 0, among `count` runs."""
    return "" if number == 0 else " (ghost)" if count == 2 else f" (ghost {number})"


def thinned(columns: np.ndarray, buckets: int = _BUCKETS) -> np.ndarray:
    """Indices of samples (m, c) that keep the least and the largest of each column in each bucket, and both ends."""
    m = len(columns)
    return np.arange(m) if m <= 4 * buckets else extremes(columns, np.linspace(0, m, buckets + 1).astype(int))


def extremes(columns: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Indices of the least and the largest finite number of each column between edges, and of both ends."""
    finite = np.isfinite(columns)
    low, high = np.where(finite, columns, np.inf), np.where(finite, columns, -np.inf)
    indices = [np.array([0, len(columns) - 1])]
    for a, b in pairwise(edges):
        indices += [a + low[a:b].argmin(axis=0), a + high[a:b].argmax(axis=0)]
    return np.unique(np.concatenate(indices))
