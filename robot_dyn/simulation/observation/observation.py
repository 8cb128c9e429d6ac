"""Observations of a run: extremes of q, v and u, the time beyond levels, and chatter.

Plain functions of arrays over rows q, v, u and runs, (3n, W); both time loops call them, for one run or W in lock step.
A run with a nan has ended and is ignored.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Annotated, NamedTuple, final

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.store import Layout
from robot_dyn.foundations.values import ReadOnly, aligned
from robot_dyn.integrate.primitives import enclose
from robot_dyn.simulation.observation.chatter import Chatter, chatters_of, close_all, tick
from robot_dyn.simulation.observation.guard_levels import GuardLevels, Level

_NONE: Mapping[int, Observation] = MappingProxyType({})


class Observation(NamedTuple):
    """The observations of W runs so far.

    Attributes:
        low, high: Extremes, (3n, W).
        inner: Interval of each row in which no run is beyond a level, (2, 3n).
        first: Number of the first level of each row, and of levels, (3n + 1,).
        sides, bounds: Sides and bounds of levels, (L,) and (L, W).
        visits: Start, duration, time and value farthest beyond a level, (4, L, W); nan without a visit.
        chatter: Chatter of u.
        latest: The latest instant at which u was observed separately, (1,), in [s].
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
    """Return the observation of W runs before their first step.

    Args:
        start: q, v, u at 0 s, (3n, W); nan for u if it is unknown before the first tick.
        levels: Levels of the runs.
    """
    (observation,) = observations_of(start, levels, 1)
    return observation


def observations_of(start: Array, levels: GuardLevels, tiles: int) -> list[Observation]:
    """Return `observation_of` for each of some tiles, of the same number of runs in lock step."""
    rows, W = start.shape[0], start.shape[1] // tiles

    def tiled(x: Array) -> Array:
        """Return an array (…, runs) as (tiles, …, W)."""
        array = aligned((tiles, *x.shape[:-1], W))
        array[...] = np.moveaxis(x.reshape(*x.shape[:-1], tiles, W), -2, 0)
        return array

    rows_of = np.array([level.row for level in levels.levels], np.int64)
    sides = np.array([float(level.side) for level in levels.levels])
    bounds, up = tiled(levels.bounds), sides > 0
    inner = np.tile([[-np.inf], [np.inf]], (tiles, 1, rows))
    np.fmax.at(inner[:, 0].T, rows_of[~up], np.fmax.reduce(bounds[:, ~up], axis=2, initial=-np.inf).T)
    np.fmin.at(inner[:, 1].T, rows_of[up], np.fmin.reduce(bounds[:, up], axis=2, initial=np.inf).T)
    low, high = (tiled(np.where(np.isnan(start), none, start)) for none in (np.inf, -np.inf))
    visits = np.full((tiles, 4, len(rows_of), W), np.nan)
    if (low < inner[:, 0, :, None]).any() or (high > inner[:, 1, :, None]).any():
        x = tiled(start[rows_of])
        beyond = sides[:, None] * (x - bounds) > 0
        visits[:, :3] = np.where(beyond, 0.0, np.nan)[:, None]
        visits[:, 3] = np.where(beyond, x, np.nan)
    first, latest = np.searchsorted(rows_of, np.arange(rows + 1)), np.zeros((tiles, 1))
    chatters = chatters_of(rows // 3, W, tiles)
    return [
        Observation(low[k], high[k], inner[k], first, sides, bounds[k], visits[k], chatters[k], latest=latest[k])
        for k in range(tiles)
    ]


UNOBSERVED = observation_of(np.empty((3, 0)), GuardLevels((), *np.empty((2, 0, 0))))  # of no run: nothing is observed


def observe(observation: Observation, began: float, t: float, q: Array, v: Array, u: Array, acted: bool) -> None:
    """Add a step to an observation.

    Args:
        observation: The observation, which is updated.
        began: Start of the step, in [s].
        t: End of the step, in [s].
        q: Positions at its end, (n, W).
        v: Velocities at its end, (n, W).
        u: Actuation during the step, (n, W).
        acted: True if the controller acted at its start.
    """
    n = len(u)
    if acted:
        tick(observation.chatter, began, u, observation.low[2 * n :], observation.high[2 * n :])
    observe_motion(observation, began, t, q, v)
    update_range(observation, 2 * n, u, began, t, began)


def observe_motion(observation: Observation, began: float, t: float, q: Array, v: Array) -> None:
    """Add a step from `began` to t without its actuation; see `observe` for the arguments."""
    update_range(observation, 0, q, began, t, t)
    update_range(observation, len(q), v, began, t, t)


def observe_actuation(observation: Observation, t: float, u: Array, acted: bool) -> None:
    """Add the actuation (n, W) at an instant, which counts for the time since the previous one."""
    first = 2 * len(u)
    if acted:
        tick(observation.chatter, observation.latest[0], u, observation.low[first:], observation.high[first:])
    update_range(observation, first, u, observation.latest[0], t, t)
    observation.latest[0] = t


def update_range(observation: Observation, first: int, x: Array, began: float, t: float, at: float) -> None:
    """Update the extremes and level visits in rows `first` onwards with values x (n, W) of a step from `began` to t.

    The values are those at the time `at`.
    """
    for j in range(len(x)):
        row = first + j
        if enclose(
            observation.low[row], observation.high[row], x[j], observation.inner[0, row], observation.inner[1, row]
        ):
            for k in range(observation.first[row], observation.first[row + 1]):
                visit(observation.visits[:, k], observation.sides[k], observation.bounds[k], x[j], began, t, at)


def visit(visits: Array, side: float, bounds: Array, x: Array, began: float, t: float, at: float) -> None:
    """Add a step to the visits (4, W) of a level, for the runs whose x is beyond it."""
    for b in range(len(x)):
        if side * (x[b] - bounds[b]) > 0:
            if not visits[0, b] >= 0.0:
                visits[0, b], visits[1, b], visits[2, b], visits[3, b] = began, 0.0, at, x[b]
            visits[1, b] += t - began
            if side * (x[b] - visits[3, b]) > 0:
                visits[2, b], visits[3, b] = at, x[b]


@final
@dataclass(frozen=True, eq=False, repr=False)
class Observed(ReadOnly):
    """The observations of B runs of n joints from start to end.

    Attributes:
        extremes: The least and the largest of q, v and u over all steps, (B, 3, 2, n); nan if u was not observed.
        instants: Number of instants, in addition to samples, at which u was observed, (B,); 0 for every step.
        levels: L levels, in the order of rows, with the limits of the first run that has them.
        limits: Stated limits of each run, (B, L); nan for none.
        visits: Start, duration, time and value farthest beyond each level, (B, L, 4); nan without a visit.
        episodes: Start, duration and amplitude of the chatter of each joint, (B, n, 3); amplitude 0 for none.
    """

    extremes: Annotated[np.ndarray, Layout(("B", 3, 2, "n"))]
    instants: Annotated[np.ndarray, Layout(("B",), "int64")]
    levels: tuple[Level, ...]
    limits: Annotated[np.ndarray, Layout(("B", "L"))]
    visits: Annotated[np.ndarray, Layout(("B", "L", 4))]
    episodes: Annotated[np.ndarray, Layout(("B", "n", 3))]

    def __repr__(self) -> str:
        return f"<Observed: {len(self.extremes)} runs, {len(self.levels)} levels>"

    def __getitem__(self, runs: slice) -> Observed:
        """Return the observations of some of the runs."""
        arrays = {name: getattr(self, name)[runs] for name in ("extremes", "instants", "limits", "visits", "episodes")}
        return replace(self, **arrays)


def observed(
    parts: Iterable[Observation], levels: GuardLevels, again: Mapping[int, Observation] = _NONE, instants: int = 0
) -> Observed:
    """Return the observations of runs that have ended.

    Args:
        parts: Observations of consecutive runs, which together are all.
        levels: Levels of all runs.
        again: Observations of repeated runs, by number; they replace those in `parts`.
        instants: See `Observed`, for the runs that are not repeated.
    """
    parts = tuple(parts)
    for part in (*parts, *again.values()):
        close_all(part.chatter)
    arrays = [np.concatenate(arrays, axis=-1) for arrays in zip(*map(_results, parts), strict=True)]
    for run, part in again.items():
        for array, x in zip(arrays, _results(part), strict=True):
            array[..., run] = x[..., 0]
    low, high, visits, episodes = arrays
    extremes = np.stack([low, high]).reshape(2, 3, len(low) // 3, -1).transpose(3, 1, 0, 2)
    extremes[np.isinf(extremes)] = np.nan
    number = np.full(len(extremes), instants, np.int64)
    number[list(again)] = 0
    return Observed(extremes, number, levels.levels, levels.limits.T, visits.T, episodes.T)


def _results(observation: Observation) -> tuple[Array, ...]:
    """Return low, high, visits and episodes."""
    return observation.low, observation.high, observation.visits, observation.chatter.episodes
