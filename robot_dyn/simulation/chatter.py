"""Chatter: actuation that reverses at every tick, (u⁺ − u)(u − u⁻) < 0 many times in a row.

Sampled damping does so where its gain is too large for the period: v⁺ ≈ (1 − M⁻¹ kd T) v changes its sign at each tick
when an eigenvalue of M⁻¹ kd T is above 1, and grows when it is above 2. [Åström, Wittenmark, Computer-Controlled
Systems, 3rd ed., 1997, ch. 2]

Plain functions of arrays over joints and runs, (n, W), as both time loops call them at each tick.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from robot_dyn.arithmetic import Array

_REVERSALS = 10  # in a row, at least; no motion that is sampled well has so many
_PART = 0.02  # of the largest actuation of its joint so far: smaller changes are noise
_LEAST = 1e-6  # of the largest actuation of any joint so far
_OTHER = 10.0  # times the amplitude: the smaller of two episodes is not told


@final
@dataclass
class Episode:
    """Reversals in a row, or several such: from `start`, `duration` in all, u going up and down by ± `amplitude`."""

    start: float
    duration: float
    amplitude: float


class Chatter(NamedTuple):
    """The reversals of W runs.

    Attributes:
        t: Of the latest tick, (1,), in [s].
        u, change: The actuation at that tick, and by how much it changed there, (n, W); nan before there is one.
        count: Reversals in a row so far, (n, W).
        streak: Their start, duration and amplitude, (3, n, W).
        going: In how many runs there are some, (n,).
        episodes: Start, duration and amplitude of those told, (3, n, W); of amplitude 0 where there are none.
    """

    t: Array
    u: Array
    change: Array
    count: Array
    streak: Array
    going: Array
    episodes: Array


def chatter_of(n: int, W: int) -> Chatter:
    """Of W runs before their first tick."""
    u, change = np.full((2, n, W), np.nan)
    counts = np.zeros((n, W), np.int64), np.zeros(n, np.int64)
    return Chatter(np.zeros(1), u, change, counts[0], np.zeros((3, n, W)), counts[1], np.zeros((3, n, W)))


def tick(of: Chatter, t: float, u: Array, low: Array, high: Array) -> None:
    """A tick at t with the actuation u (n, W), which lay between low and high (n, W) before."""
    for j in range(len(u)):
        if of.going[j] > 0 or reverses(u[j], of.u[j], of.change[j], low[j], high[j]):
            for b in range(u.shape[1]):
                count(of, j, b, t, u[j, b], low[:, b], high[:, b])
        follow(of.u[j], of.change[j], u[j])
    of.t[0] = t


def reverses(u: Array, before: Array, change: Array, low: Array, high: Array) -> bool:
    """Whether the actuation (W,) of a joint reverses by more than noise in any run."""
    found = False
    for b in range(len(u)):
        size = high[b] if high[b] > -low[b] else -low[b]
        found |= (u[b] - before[b]) * change[b] < -((_PART * size) ** 2)
    return found


def follow(before: Array, change: Array, u: Array) -> None:
    """Take the actuation (W,) of a joint."""
    for b in range(len(u)):
        change[b] = u[b] - before[b]
        before[b] = u[b]


def count(of: Chatter, j: int, b: int, t: float, u: float, low: Array, high: Array) -> None:
    """Count a reversal of joint j in run b at the tick before t, or the end of a row of them."""
    largest = 0.0
    for i in range(len(low)):
        largest = max(largest, high[i], -low[i])
    least = max(_PART * max(high[j], -low[j]), _LEAST * largest)
    change = u - of.u[j, b]
    if change * of.change[j, b] < -(least**2):
        if of.count[j, b] == 0:
            of.going[j] += 1
            of.streak[0, j, b], of.streak[2, j, b] = of.t[0], 0.0
        of.count[j, b] += 1
        of.streak[1, j, b] = t - of.streak[0, j, b]
        of.streak[2, j, b] = max(of.streak[2, j, b], abs(change) / 2, abs(of.change[j, b]) / 2)
    elif of.count[j, b] > 0:
        close(of, j, b)


def close(of: Chatter, j: int, b: int) -> None:
    """The end of a row of reversals: an episode if there were enough of them."""
    if of.count[j, b] >= _REVERSALS:
        duration, amplitude, known = of.streak[1, j, b], of.streak[2, j, b], of.episodes[2, j, b]
        if amplitude > _OTHER * known:
            of.episodes[0, j, b], of.episodes[1, j, b], of.episodes[2, j, b] = of.streak[0, j, b], duration, amplitude
        elif amplitude > known / _OTHER:
            of.episodes[1, j, b] += duration
            of.episodes[2, j, b] = max(known, amplitude)
    of.count[j, b] = 0
    of.going[j] -= 1


def close_all(of: Chatter) -> None:
    """No more ticks: what goes on has ended."""
    for j, b in np.argwhere(of.count > 0):
        close(of, j, b)
