"""A trajectory in a notebook: its summary, and small plots of q, v and u."""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.display import legend, page, plot, side_by_side, text
from robot_dyn.queries.units import joint_units
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.simulation.results.run_data import TrajectoryData

_MOST_JOINTS = 8  # of which curves are drawn


def trajectory_html(run: TrajectoryData) -> str:
    """The summary and plots over time."""
    joints = run.joint_names[:_MOST_JOINTS]
    types = joint_types(run)
    plots = [
        plot(f"{name} [{joint_units(name, types)}]", run.t, dict(zip(joints, getattr(run, name).T, strict=False)))
        for name in ("q", "v")
    ]
    if np.any(run.u):
        plots.append(plot(f"u [{joint_units('tau', types)}]", run.t, dict(zip(joints, run.u.T, strict=False))))
    more = len(run.joint_names) - len(joints)
    note = f"curves of the first {len(joints)} joints; {more} more are not drawn" if more else ""
    return page("Trajectory", text(run.summary), legend(joints), side_by_side(plots), text(note) if note else "")
