"""Series: the columns of runs that the page plots: q, v, u, tracking error, ledger; the difference of two runs.

Ledger: E(t) − E(0) = Σ W_k + residual.

Long runs are thinned: of each bucket of samples the least and the largest of each column stay, so no peak is lost.
A plot whose curves are all 0, or all absent, has no series and says why.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.queries.units import unit
from robot_dyn.simulation.comparison.difference import comparable, difference
from robot_dyn.simulation.results.run_data import TrajectoryData

if TYPE_CHECKING:
    from robot_dyn.model.robot import Robot
    from robot_dyn.view.stage import Stage

Columns = dict[str, np.ndarray]  # by name

_BUCKETS = 2000  # no plot is wider in pixels of a screen
_MOST = 1e38  # of single precision
_UNSTATED = 1e300  # what a file states from here on limits nothing


def plots(runs: list[TrajectoryData], stages: list[Stage], names: list[str]) -> list[dict[str, Any]]:
    """Return title, unit, times, series and limits of each plot, and why it has none.

    A series has one colour in the run and its ghosts; desired positions and velocities have that of the joint.
    """
    types = {"revolute" if body.revolute else "prismatic" for stage in stages for body in stage.linkage.bodies}
    kind = types.pop() if len(types) == 1 else None
    marks = ["", *(f" ({name})" for name in names[1:])]
    each = {name: [_by_joint(run, getattr(run, name)) for run in runs] for name in ("q", "v", "u")}
    robot = stages[0].robot
    found = [
        _plot("joint positions q", unit("q", kind), runs, marks, each["q"], _desired(runs, "desired"))
        | _limits(robot, robot.lower, robot.upper, each["q"]),
        _plot("joint velocities v", unit("v", kind), runs, marks, each["v"], _desired(runs, "desired_velocity"))
        | _limits(robot, -robot.velocity_limit, robot.velocity_limit, each["v"]),
        _plot("actuation u", unit("u", kind), runs, marks, each["u"])
        | _limits(robot, -robot.effort_limit, robot.effort_limit, each["u"]),
    ]
    if any(run.deviation is not None for run in runs):
        of_frame = all(run.desired is None for run in runs)
        title, of = ("tracking error p − p_d", "m") if of_frame else ("tracking error q − q_d", unit("q", kind))
        found.append(_plot(title, of, runs, marks, [_deviation(run) for run in runs]))
    found += [_difference(runs[0], run, names[0], name, unit("q", kind)) for run, name in _others(runs, names)]
    return [*found, _plot("energy ledger", "J", runs, marks, [_energy(run) for run in runs])]


def _by_joint(run: TrajectoryData, x: np.ndarray) -> Columns:
    return dict(zip(run.joint_names, x.T, strict=True))


def _desired(runs: list[TrajectoryData], field: str) -> list[Columns]:
    """Desired values of each run; none where they are those of the first."""
    found, first = [], getattr(runs[0], field)
    for run in runs:
        x = getattr(run, field)
        again = run is not runs[0] and first is not None and np.array_equal(x, first)
        found.append({} if x is None or again else _by_joint(run, x))
    return found


def _deviation(run: TrajectoryData) -> Columns:
    if run.deviation is None:
        return {}
    names = run.joint_names if run.desired is not None else [f"frame, {axis}" for axis in "xyz"]
    return dict(zip(names, run.deviation.T, strict=True))


def _energy(run: TrajectoryData) -> Columns:
    ledger, m = run.ledger, len(run.t)
    energy = {
        "K": ledger.kinetic,
        "V − V(0)": ledger.potential - ledger.potential[0],
        "E − E(0)": ledger.energy - ledger.energy[0],
    }
    energy |= {f"W {name}": work for name, work in ledger.work.items()} | {"residual": ledger.residual}
    return {name: column[:m] for name, column in energy.items()}


def _others(runs: list[TrajectoryData], names: list[str]) -> list[tuple[TrajectoryData, str]]:
    """The runs that can be compared with the first, with their names."""
    return [(run, name) for run, name in zip(runs[1:], names[1:], strict=True) if comparable(runs[0], run)]


def _difference(a: TrajectoryData, b: TrajectoryData, of_a: str, of_b: str, of_q: str) -> dict[str, Any]:
    """Positions of a run less those of the first, and when they part."""
    found = difference(a, b)
    if found.parted is not None:
        at = f": they part at t = {found.parted:.4g} s"
    elif found.is_conclusive:
        at = ": they do not part"
    else:
        at = f": compared over {found.fraction:.0%} of the time only; record both at the same times"
    title = f"difference of q, {of_b} − {of_a}{at}"
    if not len(found.t):
        empty = {"t": found.t, "limits": [], "beyond": "", "series": []}
        return {"title": title, "unit": of_q, **empty, "why": "no common samples"}
    columns = dict(zip(found.joint_names, found.q.T, strict=True))
    return _drawn(title, of_q, [(found.t, columns, "", False, False)])


def _plot(
    title: str,
    unit: str,
    runs: list[TrajectoryData],
    marks: list[str],
    columns: list[Columns],
    desired: list[Columns] | None = None,
) -> dict[str, Any]:
    """The plot of columns of runs, and of desired ones."""
    drawn = [(run.t, each, mark, mark != "", False) for run, each, mark in zip(runs, columns, marks, strict=True)]
    of_reference = zip(runs, desired or [], marks, strict=False)
    drawn += [(run.t, each, f" desired{mark}", mark != "", True) for run, each, mark in of_reference]
    dashed = ", desired dotted" if any(desired or []) else ""
    return _drawn(title + dashed, unit, drawn)


def _drawn(title: str, unit: str, parts: list[tuple[np.ndarray, Columns, str, bool, bool]]) -> dict[str, Any]:
    """A plot of (times, columns, mark, whether a ghost, whether desired), at the times that thinning keeps of any.

    Numbers are nan where a run has ended. Columns that are nan throughout are left out.
    """
    parts = [part for part in parts if part[1]]
    times = [t[thinned(np.stack(list(each.values()), axis=1))] for t, each, *_ in parts]
    t = np.unique(np.concatenate(times))
    colors = {name: index for index, name in enumerate(dict.fromkeys(name for part in parts for name in part[1]))}
    series = []
    for known, columns, mark, ghost, desired in parts:
        for name, values in columns.items():
            y = np.interp(t, known, np.clip(values, -_MOST, _MOST), right=np.nan).astype(np.float32)
            look = {"label": name + mark, "values": y, "color": colors[name], "ghost": ghost, "desired": desired}
            series.append(look)
    every = np.concatenate([each["values"] for each in series])
    plot = {"title": title, "unit": unit, "t": t, "limits": [], "beyond": ""}
    if np.nan_to_num(every).any():
        return plot | {"series": series, "why": ""}
    return plot | {"series": [], "why": "not recorded" if np.isnan(every).all() else "0 throughout"}


def _limits(robot: Robot, lower: np.ndarray, upper: np.ndarray, columns: list[Columns]) -> dict[str, Any]:
    """Limits of the file: those that are drawn, since they are near the curve of their joint, and in words the others.

    Near is within 1.5 times the largest value of its joint, or within a tenth of the height of all curves; and within
    half this height, so that no limit makes the curves much flatter.
    """
    every = np.concatenate([x for each in columns for x in each.values()])
    every = every[np.isfinite(every)]
    if not every.any():
        return {}
    near, drawn, beyond = np.ptp(every) / 2, {}, {}
    for index, name in enumerate(robot.joint_names):
        own = np.concatenate([each.get(name, every[:0]) for each in columns])
        own = own[np.isfinite(own)]
        for side, sign in ((float(lower[index]), -1), (float(upper[index]), 1)):
            if not (np.isfinite(side) and abs(side) < _UNSTATED and len(own)):
                continue
            peak = (sign * own).max()
            gap = sign * side - peak
            is_near = gap <= near and (gap <= near / 5 or sign * side <= 1.5 * peak)
            (drawn if is_near else beyond).setdefault(side, []).append(name)
    limits = [{"value": value, "label": _of(names)} for value, names in sorted(drawn.items())]
    return {"limits": limits, "beyond": _in_words(beyond)}


def _in_words(beyond: dict[float, list[str]]) -> str:
    """Joints and their limits, lower … upper, or ± where these differ by their sign alone."""
    of: dict[tuple[str, ...], list[float]] = {}
    for value, names in beyond.items():
        of.setdefault(tuple(names), []).append(value)
    texts = []
    for names, (first, *others) in ((names, sorted(values)) for names, values in of.items()):
        both = f"±{-first:.4g}" if others == [-first] else " … ".join(f"{x:.4g}" for x in (first, *others))
        texts.append(f"{_of(list(names)).strip('()')} {both.replace('-', '−')}")
    return "; ".join(texts)


def _of(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"({len(names)} joints)"


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
