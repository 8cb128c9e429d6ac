"""The observer of a run: sees t, q, v, u of every step, whatever is recorded, in memory that does not grow with it.

A time loop writes a column for each step into `columns`; when it is full, NumPy looks at all of them at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.simulation.chatter import Chatter
from robot_dyn.simulation.levels import Level

CHUNK = 16384  # columns looked at together: with fewer, the calls of NumPy cost more than what they do
_PAD = 8  # so that the rows of a column lie in different sets of the processor's cache
_WINDOW = 64  # columns whose extremes are kept as one, at first
_WINDOWS = 256  # at most so many are kept: beyond, two become one, and the next are twice as wide


@final
@dataclass
class Visit:
    """The time a quantity spent beyond a level: from `start`, `duration` in all, farthest at `at` with `value`."""

    start: float
    duration: float
    at: float
    value: float


@final
class Observer:
    """What is seen of a run so far.

    Args:
        start: q, v, u at 0 s, (3n,); nan where u is not known before the first tick.
        levels: To be looked out for.
        canonical: As below.

    Attributes:
        columns: (2 + 3n, CHUNK and some): end of the step in [s]; 1 where the controller acted at its start, else 0;
            q and v at its end; the actuation u during it.
        filled: Number of columns written.
        seen: v and u of the latest evaluation of the equation of motion, (2n,).
        canonical: Whether steps are in (q, p).
        visits: By level.
        chatter: Of the actuation.
    """

    def __init__(self, start: Array, levels: tuple[Level, ...] = (), canonical: bool = False) -> None:
        self.n, self.canonical = len(start) // 3, canonical
        self.columns, self.filled, self._chunk = np.empty((2 + 3 * self.n, CHUNK + _PAD)), 0, CHUNK
        self.seen = np.zeros(2 * self.n)
        self.visits: dict[Level, Visit] = {}
        self.chatter = Chatter(self.n)
        self._t, self._levels = 0.0, levels
        self._edges, self._width = np.zeros(1), _WINDOW
        self._low, self._high = (np.empty((0, 3 * self.n)) for _ in range(2))
        self._start = start
        for level in levels:
            if level.side * (start[level.row] - level.bound) > 0:
                self.visits[level] = Visit(0.0, 0.0, 0.0, float(start[level.row]))

    @property
    def room(self) -> int:
        """Columns that can still be written."""
        return self._chunk - self.filled

    def step(self, t: float, y: Array, acted: bool) -> None:
        """One step to the state y at t; whether the controller `acted` at its start. Its actuation is `seen`."""
        n, column = self.n, self.columns[:, self.filled]
        column[0], column[1], column[2 : 2 + 2 * n] = t, acted, y[: 2 * n]
        column[2 + 2 * n :] = self.seen[n:]
        if self.canonical:
            column[2 + n : 2 + 2 * n] = self.seen[:n]
        self.filled += 1
        self.look()

    def close(self) -> None:
        """Look at the last steps."""
        self.look(end=True)
        self.chatter.close()

    def look(self, end: bool = False) -> None:
        """Look at the columns if there is no room for more, or at the end of the run."""
        if self.room and not (end and self.filled):
            return
        t, x = self.columns[0, : self.filled], self.columns[2:, : self.filled]
        acted = self.columns[1, : self.filled] > 0
        began = np.append(self._t, t[:-1])
        with np.errstate(all="ignore"):
            low, high = self._windows(t, x)
            self._visit(began, t, x, low, high)
            u, largest = x[2 * self.n :], np.maximum(high, -low)[2 * self.n :]
            if not acted.all():
                began, u = began[acted], u[:, acted]
            self.chatter.take(began, u, largest)
        self._t, self.filled = float(t[-1]), 0

    @property
    def windows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Edges (w + 1,) in [s] of windows of time, and the least and the largest (w, 3n) of q, v, u in each."""
        return self._edges, self._low, self._high

    @property
    def extremes(self) -> np.ndarray:
        """The least and the largest of q, v and u over all steps, (3, 2, n)."""
        low = np.fmin.reduce(np.vstack([self._start, self._low]))
        high = np.fmax.reduce(np.vstack([self._start, self._high]))
        return np.stack([low.reshape(3, -1), high.reshape(3, -1)], axis=1)

    def _windows(self, t: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Keep the extremes of each window; those of all columns, (3n,) each."""
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
        return low.min(axis=1), high.max(axis=1)

    def _halve(self) -> None:
        """Two windows become one; from now on each is twice as wide, up to a whole chunk."""
        pairs = np.arange(0, len(self._low), 2)
        self._low, self._high = np.minimum.reduceat(self._low, pairs), np.maximum.reduceat(self._high, pairs)
        self._edges = np.append(self._edges[pairs], self._edges[-1])
        self._width = min(2 * self._width, self._chunk)

    def _visit(self, began: np.ndarray, t: np.ndarray, x: np.ndarray, low: np.ndarray, high: np.ndarray) -> None:
        """Add to the time beyond each level that any column is beyond of."""
        for level in self._levels:
            farthest = high[level.row] if level.side > 0 else low[level.row]
            if not level.side * (farthest - level.bound) > 0:
                continue
            row = x[level.row]
            beyond = np.flatnonzero(level.side * (row - level.bound) > 0)
            most = int(row.argmax() if level.side > 0 else row.argmin())
            at = float((began if level.row >= 2 * self.n else t)[most])
            visit = self.visits.setdefault(level, Visit(float(began[beyond[0]]), 0.0, at, float(row[most])))
            visit.duration += float((t[beyond] - began[beyond]).sum())
            if level.side * (row[most] - visit.value) > 0:
                visit.at, visit.value = at, float(row[most])
