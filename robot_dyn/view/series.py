"""Series: the columns of runs that the page plots: q, v, u, tracking error, ledger; the difference of two runs.

Ledger: E(t) − E(0) = Σ W_k + residual.

Long runs are thinned to the smallest and largest value of each column in each bucket of samples, so no peak is lost.
A plot whose curves are all 0, or all missing, has no series but a reason.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from robot_dyn.queries.units import unit
from robot_dyn.simulation.comparison.difference import comparable, difference
from robot_dyn.simulation.results.run_data import TrajectoryData

if TYPE_CHECKING:
    from robot_dyn.view.stage import Stage

Columns = dict[str, np.ndarray]  # by name

_BUCKETS = 2000  # more than the pixels of any plot
_MAX = 1e38  # largest number in single precision
_UNSTATED = 1e300  # a limit of this size means none


class Curve(NamedTuple):
    """Values over times t, both (m,), of a run or a ghost; `mark` follows the name and identifies the run."""

    name: str
    t: np.ndarray
    values: np.ndarray
    mark: str = ""
    is_ghost: bool = False
    is_desired: bool = False


def plots(runs: list[TrajectoryData], stages: list[Stage], names: list[str]) -> list[dict[str, Any]]:
    """Return title, unit, times, series and limits of each plot, or the reason why it has no series.

    A series has the same colour in the run and its ghosts; desired positions and velocities have that of the joint.
    """
    types = {"revolute" if body.revolute else "prismatic" for stage in stages for body in stage.linkage.bodies}
    kind = types.pop() if len(types) == 1 else None
    marks = [f" ({name})" for name in names] if len(names) > 1 else [""]
    robot, first, found = stages[0].robot, runs[0], []

    efforts = effort_limits(first, robot.effort_limit)

    def curves(columns: Iterable[Columns], is_desired: bool = False) -> list[Curve]:
        return [
            Curve(name, run.t, values, mark, number > 0, is_desired)
            for number, (run, mark, of_run) in enumerate(zip(runs, marks, columns, strict=True))
            for name, values in of_run.items()
        ]

    for title, symbol, reference, lower, upper in (
        ("joint positions q", "q", "desired", robot.lower, robot.upper),
        ("joint velocities v", "v", "desired_velocity", -robot.velocity_limit, robot.velocity_limit),
        ("actuation u", "u", "", -efforts, efforts),
    ):
        actual = curves(_by_joint(run, getattr(run, symbol)) for run in runs)
        desired = curves((_desired(run, first, reference) for run in runs), True) if reference else []
        dotted = ", desired dotted" if desired else ""
        limits = _limits(robot.joint_names, lower, upper, actual)
        found.append(_plot(title + dotted, unit(symbol, kind), actual + desired) | limits)
    if any(run.tracking_error is not None for run in runs):
        of_frame = all(run.desired is None for run in runs)
        title, of = ("tracking error p_d − p", "m") if of_frame else ("tracking error q_d − q", unit("q", kind))
        found.append(_plot(title, of, curves(_tracking_error(run) for run in runs)))
    for run, name in zip(runs[1:], names[1:], strict=True):
        if comparable(first, run):
            found.append(_difference(first, run, names[0], name, unit("q", kind)))
    return [*found, _plot("energy ledger", "J", curves(_energy(run) for run in runs))]


def effort_limits(run: TrajectoryData, stated: np.ndarray) -> np.ndarray:
    """Return the effort limit of each joint that acted in a run, otherwise that of the file, (n,).

    Limits of an `EffortLimit` of the plant and of a PID act; the smaller one counts.

    Args:
        run: The run, whose settings contain the limits as texts, such as "15, inf N m".
        stated: Limits of the file, (n,).
    """
    acting = np.full(len(stated), np.inf)
    for name, text in json.loads(run.metadata.get("settings", "{}")).items():
        if name.partition(" (")[0] in ("effort_limit.limit", "control.effort_limit") and "numbers" not in text:
            acting = np.minimum(acting, [float(x) for x in re.findall(r"inf|\d[\d.e+-]*", text)])
    return np.where(np.isfinite(acting), acting, stated)


def _by_joint(run: TrajectoryData, x: np.ndarray) -> Columns:
    return dict(zip(run.joint_names, x.T, strict=True))


def _desired(run: TrajectoryData, first: TrajectoryData, field: str) -> Columns:
    """Return the desired values of a run; {} if they equal those of the first run."""
    x, of_first = getattr(run, field), getattr(first, field)
    again = run is not first and of_first is not None and np.array_equal(x, of_first)
    return {} if x is None or again else _by_joint(run, x)


def _tracking_error(run: TrajectoryData) -> Columns:
    if run.tracking_error is None:
        return {}
    names = run.joint_names if run.desired is not None else [f"frame, {axis}" for axis in "xyz"]
    return dict(zip(names, run.tracking_error.T, strict=True))


def _energy(run: TrajectoryData) -> Columns:
    ledger, m = run.ledger, len(run.t)
    energy = {
        "K": ledger.kinetic,
        "V − V(0)": ledger.potential - ledger.potential[0],
        "E − E(0)": ledger.energy - ledger.energy[0],
    }
    energy |= {f"W {name}": work for name, work in ledger.work.items()} | {"residual": ledger.residual}
    return {name: column[:m] for name, column in energy.items()}


def _difference(a: TrajectoryData, b: TrajectoryData, of_a: str, of_b: str, of_q: str) -> dict[str, Any]:
    """Return the positions of a run minus those of the first, and the time at which they diverge."""
    found = difference(a, b)
    if found.parted_s is not None:
        at = f": they part at t = {found.parted_s:.4g} s"
    elif found.is_conclusive:
        at = ": they do not part"
    else:
        at = f": compared over only {found.fraction:.0%} of the time; record both at the same times"
    curves = [Curve(name, found.t, x) for name, x in zip(found.joint_names, found.q.T, strict=True)]
    return _plot(f"difference of q, {of_b} − {of_a}{at}", of_q, curves)


def _plot(title: str, unit: str, curves: list[Curve]) -> dict[str, Any]:
    """Return a plot of curves at the times that thinning keeps for any of them; nan after the end of a run.

    Curves with the same name, such as those of a joint in several runs, are adjacent, also in the legend.
    """
    curves = [curve for curve in curves if len(curve.t)]
    t = np.unique(np.concatenate([np.zeros(0), *(curve.t[thinned(curve.values[:, None])] for curve in curves)]))
    colors = {name: index for index, name in enumerate(dict.fromkeys(curve.name for curve in curves))}
    curves.sort(key=lambda curve: colors[curve.name])
    series = [
        {
            "label": f"{curve.name}{' desired' * curve.is_desired}{curve.mark}",
            "values": np.interp(t, curve.t, np.clip(curve.values, -_MAX, _MAX), right=np.nan).astype(np.float32),
            "color": colors[curve.name],
            "ghost": curve.is_ghost,
            "desired": curve.is_desired,
        }
        for curve in curves
    ]
    every = np.concatenate([np.zeros(0), *(curve["values"] for curve in series)])
    is_drawn = bool(np.nan_to_num(every).any())
    why = "0 throughout" if not np.isnan(every).all() else "not recorded" if series else "no common samples"
    plot = {"title": title, "unit": unit, "t": t, "limits": [], "beyond": ""}
    return plot | {"series": series if is_drawn else [], "why": "" if is_drawn else why}


def _limits(names: Sequence[str], lower: np.ndarray, upper: np.ndarray, curves: list[Curve]) -> dict[str, Any]:
    """Return the limits to draw, which are near the curve of their joint, and the others as text.

    Near means within 1.5 times the largest value of the joint, or within a tenth of the height of all curves; and
    within half this height, so that no limit flattens the curves much.
    """
    every = _finite(curves)
    if not every.any():
        return {}
    near, drawn, beyond = np.ptp(every) / 2, {}, {}
    for index, name in enumerate(names):
        own = _finite([curve for curve in curves if curve.name == name])
        for side, sign in ((float(lower[index]), -1), (float(upper[index]), 1)):
            if np.isfinite(side) and abs(side) < _UNSTATED and len(own):
                peak = (sign * own).max()
                gap = sign * side - peak
                is_near = gap <= near and (gap <= near / 5 or sign * side <= 1.5 * peak)
                (drawn if is_near else beyond).setdefault(side, []).append(name)
    limits = [{"value": value, "label": _of(names)} for value, names in sorted(drawn.items())]
    return {"limits": limits, "beyond": _in_words(beyond)}


def _finite(curves: list[Curve]) -> np.ndarray:
    values = np.concatenate([np.zeros(0), *(curve.values for curve in curves)])
    return values[np.isfinite(values)]


def _in_words(beyond: dict[float, list[str]]) -> str:
    """Return joints and their limits as text: lower … upper, or ± if they differ only in sign."""
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
    """Return indices of samples (m, c): the smallest and largest of each column in each bucket, and both ends."""
    m = len(columns)
    if m <= 4 * buckets:
        return np.arange(m)
    finite = np.isfinite(columns)
    low, high = np.where(finite, columns, np.inf), np.where(finite, columns, -np.inf)
    indices = [np.array([0, m - 1])]
    for a, b in pairwise(np.linspace(0, m, buckets + 1).astype(int)):
        indices += [a + low[a:b].argmin(axis=0), a + high[a:b].argmax(axis=0)]
    return np.unique(np.concatenate(indices))
