"""Rests: intervals in which dry friction or a rigid stop holds a joint, from the samples and events of a run.

A held joint has v = 0 and exactly the same q at two successive times.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from robot_dyn.simulation.results.run_data import TrajectoryData

_HOLD = {"dry_friction", "rigid_stops"}  # names of effects that hold joints
_MAX = 200  # rests of a joint


class Rest(NamedTuple):
    """An interval in which a joint is held.

    Attributes:
        start, end: Start and end, in [s].
        at_stop: True if it rests at a stop.
    """

    start: float
    end: float
    at_stop: bool


def rests(run: TrajectoryData) -> tuple[tuple[Rest, ...], ...]:
    """Return the first rests of each joint, by time; () in runs without effects that hold joints."""
    names = run.joint_names
    if not _HOLD & set(run.acting or ()):
        return ((),) * len(names)
    events = [event for event in run.events if len(event.q) == len(names)]
    t = np.concatenate([run.t, [event.t for event in events]])
    order = np.argsort(t, kind="stable")
    q, v = (
        np.concatenate([x, np.array([getattr(event, name) for event in events]).reshape(-1, len(names))])[order]
        for name, x in (("q", run.q), ("v", run.v))
    )
    return tuple(_of_joint(run, i, t[order], q[:, i], v[:, i]) for i in range(len(names)))


def lanes(run: TrajectoryData, prefix: str, most_events: int) -> Iterator[dict[str, Any]]:
    """Yield the entries `rests` of a page's document: rests and events of each joint that has rests."""
    for name, spans in zip(run.joint_names, rests(run), strict=True):
        if spans:
            events = [(event.t, event.name) for event in run.events if event.joint == name]
            yield {"joint": prefix + name, "spans": [list(event) for event in spans], "events": events[:most_events]}


def _of_joint(run: TrajectoryData, i: int, t: np.ndarray, q: np.ndarray, v: np.ndarray) -> tuple[Rest, ...]:
    held = (v[1:] == 0) & (v[:-1] == 0) & (q[1:] == q[:-1])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(int)))
    stops = set() if run.at_stop is None else set(run.q[run.at_stop[:, i], i].tolist())
    intervals = (Rest(float(t[a]), float(t[b]), float(q[a]) in stops) for a, b in edges.reshape(-1, 2) if t[b] > t[a])
    return tuple(intervals)[:_MAX]
