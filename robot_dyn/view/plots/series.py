"""Series: the columns of runs that the page plots: q, v, τ and the ledger, E(t) − E(0) = Σ W_k + residual.

Long runs are thinned: of each bucket of samples the least and the largest of each column stay, so no peak is lost.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.view.stage import Stage

_BUCKETS = 500  # a plot is about as wide in pixels
_MOST = 1e38  # of single precision


def plots(runs: list[Trajectory], stages: list[Stage]) -> list[dict[str, Any]]:
    """Title, unit, times and series of each plot; the series of a ghost wear the colours of the run's."""
    revolute = [body.revolute for stage in stages for body in stage.linkage.bodies]
    q, force = ("rad", "N m") if all(revolute) else ("m", "N") if not any(revolute) else ("rad or m", "N m or N")
    titles = (
        ("joint positions q", q),
        ("joint velocities v", " or ".join(f"{part}/s" for part in q.split(" or "))),
        ("actuation u", force),
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
    """The series of all runs at the times that any of them keeps; nan where a run has ended."""
    kept = [run.t[thinned(np.stack(list(each.values()), axis=1))] for run, each in zip(runs, columns, strict=True)]
    t = np.unique(np.concatenate(kept))
    colors = {name: index for index, name in enumerate(dict.fromkeys(name for each in columns for name in each))}
    series = []
    for number, (run, each) in enumerate(zip(runs, columns, strict=True)):
        mark = "" if not number else " (ghost)" if len(runs) == 2 else f" (ghost {number})"
        for name, values in each.items():
            drawn = np.interp(t, run.t, np.clip(values, -_MOST, _MOST), right=np.nan).astype(np.float32)
            series.append({"label": name + mark, "values": drawn, "color": colors[name], "ghost": number > 0})
    return {"t": t, "series": series}


def thinned(columns: np.ndarray, buckets: int = _BUCKETS) -> np.ndarray:
    """Indices of samples (m, c) that keep the least and the largest of each column in each bucket, and both ends."""
    m = len(columns)
    if m <= 4 * buckets:
        return np.arange(m)
    columns = np.nan_to_num(columns)  # what has no value is not an extreme
    edges = np.linspace(0, m, buckets + 1).astype(int)
    kept = [np.array([0, m - 1])]
    for a, b in pairwise(edges):
        kept += [a + columns[a:b].argmin(axis=0), a + columns[a:b].argmax(axis=0)]
    return np.unique(np.concatenate(kept))
