"""Rollouts in a notebook: their summary, and plots of the median of q and its range over the runs."""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.display import legend, page, plot, side_by_side, text
from robot_dyn.queries.units import unit
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.simulation.rollouts.rollouts_data import RolloutsData

_MOST_JOINTS, _MOST_RUNS = 8, 2000
_QUANTILES = {"least": 0.0, "median": 0.5, "largest": 1.0}


def rollouts_html(runs: RolloutsData) -> str:
    """The summary; of the first joints the least, the median and the largest q over the runs."""
    if runs.q is None or not len(runs):
        return page("Rollouts", text(runs.summary))
    some = runs.q[np.linspace(0, len(runs) - 1, min(len(runs), _MOST_RUNS)).astype(int)]
    plots = []
    for i, (name, kind) in enumerate(list(zip(runs.joint_names, joint_types(runs), strict=True))[:_MOST_JOINTS]):
        with np.errstate(all="ignore"):
            at = [np.nanquantile(some[:, :, i], level, axis=0) for level in _QUANTILES.values()]
        plots.append(plot(f"{name} [{unit('q', kind)}]", runs.t, dict(zip(_QUANTILES, at, strict=True))))
    parts = [text(runs.summary), legend(_QUANTILES), side_by_side(plots)]
    if more := len(runs.joint_names) - len(plots):
        parts.append(text(f"curves of the first {len(plots)} joints; {more} more are not drawn"))
    return page("Rollouts", *parts)
