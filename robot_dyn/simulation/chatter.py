"""Chatter: actuation that reverses at every tick, (u⁺ − u)(u − u⁻) < 0 many times in a row.

Sampled damping does so where its gain is too large for the period: v⁺ ≈ (1 − M⁻¹ kd T) v changes its sign at each tick
when an eigenvalue of M⁻¹ kd T is above 1, and grows when it is above 2. [Åström, Wittenmark, Computer-Controlled
Systems, 3rd ed., 1997, ch. 2]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

_REVERSALS = 10  # in a row, at least; no motion that is sampled well has so many
_PART = 0.02  # of the largest actuation of its joint: smaller changes are noise
_LEAST = 1e-6  # of the largest actuation of any joint
_OTHER = 10.0  # times the amplitude: the smaller of two episodes is not told


@final
@dataclass
class Episode:
    """Reversals in a row, or several such: from `start`, `duration` in all, u going up and down by ± `amplitude`."""

    start: float
    duration: float
    amplitude: float


@final
class Chatter:
    """The chatter of n joints, from their actuation at one tick after another.

    Attributes:
        episodes: By joint.
    """

    def __init__(self, n: int) -> None:
        self.episodes: dict[int, Episode] = {}
        self._largest = np.zeros(n)
        self._t, self._u = np.empty(0), np.empty((n, 0))  # of the last two ticks
        self._streaks: dict[int, tuple[int, Episode]] = {}  # that go on: reversals so far

    def take(self, t: np.ndarray, u: np.ndarray, largest: np.ndarray) -> None:
        """Further ticks at t (k,) with the actuation u (n, k), which is `largest` (n,) at most."""
        if not len(t):
            return
        t, u = np.append(self._t, t), np.concatenate([self._u, u], axis=1)
        self._t, self._u = t[-2:], u[:, -2:].copy()
        before, self._largest = self._largest, np.fmax(self._largest, largest)
        if len(t) < 3:
            return
        change = u[:, 1:] - u[:, :-1]
        turned = change[:, 1:] * change[:, :-1]
        some = turned.min(axis=1) < -(np.maximum(_PART * before, _LEAST * before.max()) ** 2)
        some[list(self._streaks)] = True
        if not some.any():
            return
        # against what there was up to a tick: what grows is not small beside what it becomes
        so_far = np.maximum(before[:, None], np.maximum.accumulate(np.abs(u), axis=1)[:, 1:-1])
        least = np.maximum(_PART * so_far, _LEAST * so_far.max(axis=0))
        for joint in np.flatnonzero(some):
            self._runs(int(joint), t, np.abs(change[joint]) / 2, turned[joint] < -(least[joint] ** 2))

    def close(self) -> None:
        """No more ticks: what goes on has ended."""
        for joint in list(self._streaks):
            self._close(joint)

    def _runs(self, joint: int, t: np.ndarray, size: np.ndarray, reverses: np.ndarray) -> None:
        """Join the reversals of a joint that follow each other; reversal k lies at tick k + 1."""
        ends = np.flatnonzero(np.diff(np.concatenate([[0], reverses, [0]]).astype(int))).reshape(-1, 2)
        if len(ends) == 0 or ends[0, 0] > 0:
            self._close(joint)
        for a, b in ends:
            amplitude = float(size[a : b + 1].max())
            count, streak = self._streaks.get(joint, (0, Episode(float(t[a + 1]), 0.0, amplitude)))
            streak.duration = float(t[b + 1]) - streak.start
            streak.amplitude = max(streak.amplitude, amplitude)
            self._streaks[joint] = count + int(b - a), streak
            if b < len(reverses):
                self._close(joint)

    def _close(self, joint: int) -> None:
        count, streak = self._streaks.pop(joint, (0, None))
        if streak is None or count < _REVERSALS:
            return
        known = self.episodes.get(joint)
        if known is None or streak.amplitude > _OTHER * known.amplitude:
            self.episodes[joint] = streak
        elif streak.amplitude > known.amplitude / _OTHER:
            known.duration += streak.duration
            known.amplitude = max(known.amplitude, streak.amplitude)
