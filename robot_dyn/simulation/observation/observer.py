"""The observer of a run: processes t, q, v, u of every step in memory that does not grow with the run.

A time loop adds each step to `observation`, and writes a column for it into `columns`. When all columns are full, NumPy
computes the extremes over windows of time from them at once.
"""

from __future__ import annotations

from contextlib import suppress
from threading import Lock
from typing import final

import numpy as np

from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.values import cached, copied
from robot_dyn.simulation.observation.guard_levels import NO_LEVELS, GuardLevels, guard_levels
from robot_dyn.simulation.observation.observation import Observation, Observed, observation_of, observed
from robot_dyn.simulation.setup.setup import Setup

CHUNK = 16384  # columns processed together: with fewer, the overhead of NumPy calls dominates
_PAD = 8  # puts the rows of a column into different sets of the processor's cache
_WINDOW = 64  # columns in a window of time, at first
_FEW = 1000  # number of columns that may remain unprocessed until the observations are read
_WINDOWS = 256  # largest number of windows: beyond it, windows are merged in pairs, and later ones are twice as wide


@final
class Observer:
    """Observer of a run in progress.

    Args:
        start: The observation before the first step, which is continued.
        levels: Levels to observe.

    Attributes:
        observation: The observation so far.
        columns: End of each step, in [s]; q and v at its end; actuation u during it; (1 + 3n, CHUNK + padding).
        filled: Number of columns written.
    """

    def __init__(self, start: Observation, levels: GuardLevels = NO_LEVELS) -> None:
        self.n = len(start.low) // 3
        self.columns, self.filled, self._chunk = np.empty((1 + 3 * self.n, CHUNK + _PAD)), 0, CHUNK
        self.observation, self._levels = start, levels
        self._edges, self._width, self._closing = np.zeros(1), _WINDOW, Lock()
        self._low, self._high = (np.empty((0, 3 * self.n)) for _ in range(2))

    @property
    def room(self) -> int:
        """Number of free columns."""
        return self._chunk - self.filled

    @property
    def fastest(self) -> np.ndarray:
        """Largest speed of each joint so far, (n,)."""
        v = slice(self.n, 2 * self.n)
        return np.maximum(-self.observation.low[v, 0], self.observation.high[v, 0])

    def process(self, end: bool = False) -> None:
        """Process the columns if no column is free, or at the end of the run."""
        if self.room and not (end and self.filled):
            return
        with np.errstate(all="ignore"):
            self._windows(self.columns[0, : self.filled], self.columns[1:, : self.filled])
        self.filled = 0

    def end(self) -> None:
        """End the run: process the last columns or, if these are few, only trim the array to them."""
        self.process(end=self.filled > _FEW)
        self.columns = self.columns[:, : self.filled].copy()

    def close(self) -> Observed:
        """Return the observations, including the last steps; threads may call it concurrently."""
        with self._closing:
            self.process(end=True)
        return observed([self.observation], self._levels)

    @property
    def windows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Edges of windows of time, (w + 1,), in [s], and the least and the largest q, v, u in each, (w, 3n)."""
        return self._edges, self._low, self._high

    def _windows(self, t: np.ndarray, x: np.ndarray) -> None:
        """Store the extremes of each window."""
        width = min(self._width, len(t))
        whole = len(t) // width * width
        parts = x[:, :whole].reshape(len(x), -1, width)
        low, high = parts.min(axis=2), parts.max(axis=2)
        ends = t[width - 1 : whole : width]
        if whole < len(t):
            low = np.column_stack([low, x[:, whole:].min(axis=1)])
            high = np.column_stack([high, x[:, whole:].max(axis=1)])
            ends = np.append(ends, t[-1])
        self._edges = np.concatenate([self._edges, ends])
        self._low, self._high = np.vstack([self._low, low.T]), np.vstack([self._high, high.T])
        while len(self._low) > _WINDOWS:
            self._halve()

    def _halve(self) -> None:
        """Merge windows in pairs; later ones are twice as wide, up to a whole chunk."""
        pairs = np.arange(0, len(self._low), 2)
        self._low, self._high = np.minimum.reduceat(self._low, pairs), np.maximum.reduceat(self._high, pairs)
        self._edges = np.append(self._edges[pairs], self._edges[-1])
        self._width = min(2 * self._width, self._chunk)


def observer_of(setup: Setup, levels: GuardLevels | None = None) -> Observer:
    """Return the observer of a run before its first step, for the levels of the setup unless others are given."""
    if levels is not None:
        return Observer(_observation(setup, levels), levels)
    levels, start = cached(setup, observed_start)
    return Observer(copied(start), levels)


def observed_start(setup: Setup) -> tuple[GuardLevels, Observation]:
    """Return the levels of a setup, and the observation of its start."""
    levels = guard_levels(setup.plant.dynamics, setup.plant.effects, setup.controller)
    return levels, _observation(setup, levels)


def _observation(setup: Setup, levels: GuardLevels) -> Observation:
    """Return the observation of the start; nan for u if it is unknown before the first tick."""
    equation, u = setup.equation, np.full(len(setup.q0), np.nan)
    if not equation.sampled:
        with suppress(RobotDynError):  # the run reports it
            u = equation.actuation(0.0, setup.q0, setup.v0, np.zeros(equation.states), None)
    return observation_of(np.concatenate([setup.q0, setup.v0, u])[:, None], levels)
