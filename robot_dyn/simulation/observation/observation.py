"""What is observed of a run: extremes of q, v and u, the time beyond levels, and chatter.

Plain functions of arrays over rows q, v, u and runs, (3n, W), as both time loops call them: for one run, or W in lock
step. A run of which a number is nan has ended: nothing of it is taken.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Annotated, NamedTuple, final

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.store import Layout
from robot_dyn.foundations.values import Value, aligned, read_only
from robot_dyn.integrate.primitives import enclose
from robot_dyn.simulation.observation.chatter import Chatter, Episode, chatters_of, close_all, tick
from robot_dyn.simulation.observation.guard_levels import GuardLevels, Level

_NONE: Mapping[int, Observation] = MappingProxyType({})


class Observation(NamedTuple):
    """What was observed so far.

    Attributes:
        low, high: Extremes, (3n, W).
        inner: For each row the numbers between which no run is beyond a level, (2, 3n).
        first: Number of the first level of each row, and of levels, (3n + 1,).
        sides, bounds: Of levels, (L,) and (L, W).
        visits: Start, duration, time and value farthest beyond a level, (4, L, W); nan where a run never was.
        chatter: Of u.
        latest: The latest instant at which u was observed by itself, (1,), in [s].
    """

    low: Array
    high: Array
    inner: Array
    first: Array
    sides: Array
    bounds: Array
    visits: Array
    chatter: Chatter
    latest: Array


def observation_of(start: Array, levels: GuardLevels) -> Observation:
    """Of W runs that have not begun, from q, v, u at 0 s, (3n, W); nan where u is not known before the first tick."""
    (of,) = observations_of(start, levels, 1)
    return of


def observations_of(start: Array, levels: GuardLevels, tiles: int) -> list[Observation]:
    """As of `observation_of`, of runs in tiles of one size, each of which is in lock step."""
    rows, W = start.shape[0], start.shape[1] // tiles

    def tiled(x: Array) -> Array:
        """(…, runs) as (tiles, …, W)."""
        made = aligned((tiles, *x.shape[:-1], W))
        made[...] = np.moveaxis(x.reshape(*x.shape[:-1], tiles, W), -2, 0)
        return made

    of = np.array([each.row for each in levels.levels], np.int64)
    sides = np.array([float(each.side) for each in levels.levels])
    bounds, up = tiled(levels.bounds), sides > 0
    inner = np.tile([[-np.inf], [np.inf]], (tiles, 1, rows))
    np.fmax.at(inner[:, 0].T, of[~up], np.fmax.reduce(bounds[:, ~up], axis=2, initial=-np.inf).T)
    np.fmin.at(inner[:, 1].T, of[up], np.fmin.reduce(bounds[:, up], axis=2, initial=np.inf).T)
    low, high = (tiled(np.where(np.isnan(start), none, start)) for none in (np.inf, -np.inf))
    visits = np.full((tiles, 4, len(of), W), np.nan)
    if (low < inner[:, 0, :, None]).any() or (high > inner[:, 1, :, None]).any():
        x = tiled(start[of])
        beyond = sides[:, None] * (x - bounds) > 0
        visits[:, :3] = np.where(beyond, 0.0, np.nan)[:, None]
        visits[:, 3] = np.where(beyond, x, np.nan)
    first, latest = np.searchsorted(of, np.arange(rows + 1)), np.zeros((tiles, 1))
    chatters = chatters_of(rows // 3, W, tiles)
    return [
        Observation(low[k], high[k], inner[k], first, sides, bounds[k], visits[k], chatters[k], latest=latest[k])
        for k in range(tiles)
    ]


NOTHING = observation_of(np.empty((3, 0)), GuardLevels((), *np.empty((2, 0, 0))))  # of no run: nothing is observed


def observe(of: Observation, began: float, t: float, q: Array, v: Array, u: Array, acted: bool) -> None:
    """A step from `began` to t.

    Args:
        of: Becomes what was observed so far.
        began: In [s].
        t: In [s].
        q: At its end, (n, W).
        v: As q.
        u: The actuation during it, as q.
        acted: Whether the controller acted at its start.
    """
    n = len(u)
    if acted:
        tick(of.chatter, began, u, of.low[2 * n :], of.high[2 * n :])
    observe_motion(of, began, t, q, v)
    look(of, 2 * n, u, began, t, began)


def observe_motion(of: Observation, began: float, t: float, q: Array, v: Array) -> None:
    """A step from `began` to t, without its actuation; arguments as of `observe`."""
    look(of, 0, q, began, t, t)
    look(of, len(q), v, began, t, t)


def observe_actuation(of: Observation, t: float, u: Array, acted: bool) -> None:
    """The actuation (n, W) at an instant, which stands for the time since the one before."""
    first = 2 * len(u)
    if acted:
        tick(of.chatter, of.latest[0], u, of.low[first:], of.high[first:])
    look(of, first, u, of.latest[0], t, t)
    of.latest[0] = t


def look(of: Observation, first: int, x: Array, began: float, t: float, at: float) -> None:
    """Rows x (n, W) from the `first` on, which hold at a time in the step."""
    for j in range(len(x)):
        row = first + j
        if enclose(of.low[row], of.high[row], x[j], of.inner[0, row], of.inner[1, row]):
            for k in range(of.first[row], of.first[row + 1]):
                visit(of.visits[:, k], of.sides[k], of.bounds[k], x[j], began, t, at)


def visit(visits: Array, side: float, bounds: Array, x: Array, began: float, t: float, at: float) -> None:
    """Add a step to the visits (4, W) of a level in the runs whose x is beyond it."""
    for b in range(len(x)):
        if side * (x[b] - bounds[b]) > 0:
            if not visits[0, b] >= 0.0:
                visits[0, b], visits[1, b], visits[2, b], visits[3, b] = began, 0.0, at, x[b]
            visits[1, b] += t - began
            if side * (x[b] - visits[3, b]) > 0:
                visits[2, b], visits[3, b] = at, x[b]


@final
@dataclass
class Visit:
    """The time a quantity spent beyond a level: from `start`, `duration` in all, farthest at `at` with `value`."""

    start: float
    duration: float
    at: float
    value: float


@final
@dataclass(frozen=True, eq=False, repr=False)
class Observed(Value):
    """What was observed of B runs of n joints from their start to their end.

    Attributes:
        extremes: The least and the largest of q, v and u over all steps, (B, 3, 2, n); nan where u never was.
        instants: Number of the instants at which, beside samples, u was observed, (B,); 0 where it was at every step.
        levels: L levels, in the order of rows, with the limits of the first run that has them.
        limits: As stated for each run, (B, L); nan where it has none.
        visits: Start, duration, time and value farthest beyond each level, (B, L, 4); nan where a run never was.
        episodes: Start, duration and amplitude of the chatter of each joint, (B, n, 3); of amplitude 0 without any.
    """

    extremes: Annotated[np.ndarray, Layout(("B", 3, 2, "n"))]
    instants: Annotated[np.ndarray, Layout(("B",), "int64")]
    levels: tuple[Level, ...]
    limits: Annotated[np.ndarray, Layout(("B", "L"))]
    visits: Annotated[np.ndarray, Layout(("B", "L", 4))]
    episodes: Annotated[np.ndarray, Layout(("B", "n", 3))]

    def __post_init__(self) -> None:
        read_only(self)

    def __repr__(self) -> str:
        return f"<Observed: {len(self.extremes)} runs, {len(self.levels)} levels>"

    def __getitem__(self, runs: slice) -> Observed:
        """Of some of the runs."""
        taken = {name: getattr(self, name)[runs] for name in ("extremes", "instants", "limits", "visits", "episodes")}
        return replace(self, **taken)

    def visits_of(self, run: int) -> dict[Level, Visit]:
        """By level."""
        return {
            replace(self.levels[k], limit=float(self.limits[run, k])): Visit(*self.visits[run, k].tolist())
            for k in np.flatnonzero(~np.isnan(self.visits[run, :, 0]))
        }

    def episodes_of(self, run: int) -> dict[int, Episode]:
        """By joint."""
        known = np.flatnonzero(self.episodes[run, :, 2])
        return {int(joint): Episode(*self.episodes[run, joint].tolist()) for joint in known}


def observed(
    parts: Iterable[Observation], levels: GuardLevels, again: Mapping[int, Observation] = _NONE, instants: int = 0
) -> Observed:
    """What was observed of runs that have ended.

    Args:
        parts: Of all runs, those of one after those of the other.
        levels: Of all runs.
        again: Of single runs, by number, in place of what `parts` have.
        instants: As of `Observed`, of the runs that are not made again.
    """
    parts = tuple(parts)
    for part in (*parts, *again.values()):
        close_all(part.chatter)
    arrays = [np.concatenate(of, axis=-1) for of in zip(*map(_results, parts), strict=True)]
    for run, part in again.items():
        for array, x in zip(arrays, _results(part), strict=True):
            array[..., run] = x[..., 0]
    low, high, visits, episodes = arrays
    extremes = np.stack([low, high]).reshape(2, 3, len(low) // 3, -1).transpose(3, 1, 0, 2)
    extremes[np.isinf(extremes)] = np.nan
    number = np.full(len(extremes), instants, np.int64)
    number[list(again)] = 0
    return Observed(extremes, number, levels.levels, levels.limits.T, visits.T, episodes.T)


def _results(of: Observation) -> tuple[Array, ...]:
    """Low, high, visits and episodes."""
    return of.low, of.high, of.visits, of.chatter.episodes
