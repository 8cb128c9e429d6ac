"""Keyframes: the samples between which a straight line replaces a run, |q(t) − q_line(t)| ≤ tolerance at every sample.

A joint's turn is interpolated about its own axis, so a line in q is what the viewer draws between keyframes.
[Ramer 1972; Douglas, Peucker 1973]
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import final

import numpy as np

TOLERANCE = 5e-4  # [rad] or [m]; half a millimetre at a reach of one metre, below a pixel of the screen
_LARGEST_TURN = pi / 2  # between keyframes; from π on a viewer would take the shorter way round


@final
@dataclass(frozen=True, eq=False)
class Keyframes:
    """Keyframes of N joints.

    Attributes:
        t: Times, (k,), in [s]; rounded to single precision, as in the viewer.
        q: Positions, (k, N).
        samples: Number of samples they stand for.
        error: Largest deviation from a sample, for each joint, (N,), in [rad] or [m].
    """

    t: np.ndarray
    q: np.ndarray
    samples: int
    error: np.ndarray


def keyframes(t: np.ndarray, q: np.ndarray, tolerance: float = TOLERANCE) -> Keyframes:
    """Keyframes of samples t (m,), q (m, N)."""
    index = np.flatnonzero(corners(t, q, tolerance))
    times, positions = _short_turns(t[index], q[index])
    drawn = times.astype(np.float32).astype(float)
    apart = np.concatenate([[True], np.diff(drawn) > 0])
    drawn, positions = drawn[apart], positions[apart]
    error = np.array([np.abs(q[:, i] - np.interp(t, drawn, positions[:, i])).max() for i in range(q.shape[1])])
    return Keyframes(drawn, positions, len(t), error)


def corners(t: np.ndarray, q: np.ndarray, tolerance: float) -> np.ndarray:
    """Which samples are keyframes, (m,): split each span at its sample farthest from the chord until all are near."""
    chosen = np.zeros(len(t), dtype=bool)
    chosen[[0, -1]] = True
    spans = [(0, len(t) - 1)]
    while spans:
        a, b = spans.pop()
        if b - a < 2 or t[b] == t[a]:
            continue
        part = ((t[a + 1 : b] - t[a]) / (t[b] - t[a]))[:, None]
        away = np.abs(q[a + 1 : b] - (q[a] + part * (q[b] - q[a]))).max(axis=1)
        if away.max() > tolerance:
            middle = a + 1 + int(away.argmax())
            chosen[middle] = True
            spans += [(a, middle), (middle, b)]
    return chosen


def _short_turns(t: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Add keyframes where a joint turns too far between two."""
    parts = np.ceil(np.abs(np.diff(q, axis=0)).max(axis=1, initial=0.0) / _LARGEST_TURN).astype(int)
    parts = np.maximum(parts, 1)
    at = np.concatenate([k + np.arange(n) / n for k, n in enumerate(parts)] + [[len(t) - 1.0]])
    index = np.arange(len(t))
    return np.interp(at, index, t), np.stack([np.interp(at, index, column) for column in q.T], axis=1)
