"""Chatter: actuation that reverses at every tick, (u⁺ − u)(u − u⁻) < 0 many times in a row.

Sampled damping chatters if its gain is too large for the period: v⁺ ≈ (1 − M⁻¹ kd T) v changes its sign at each tick
if an eigenvalue of M⁻¹ kd T is above 1, and grows if it is above 2. [Åström, Wittenmark, Computer-Controlled Systems,
3rd ed., 1997, ch. 2]

Plain functions of arrays (n, W) over joints and runs; both time loops call them at each tick.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.primitives import copy

_REVERSALS = 10  # least number in a row; well-sampled motion has fewer
_PART = 0.02  # of the joint's largest actuation so far: smaller changes are noise
_LEAST = 1e-6  # of the largest actuation of any joint so far
_OTHER = 10.0  # ratio of amplitudes above which the smaller of two episodes is not reported


@final
@dataclass
class Episode:
    """One or more rows of reversals: first `start`, total `duration`, u alternating by ± `amplitude`."""

    start: float
    duration: float
    amplitude: float


class Chatter(NamedTuple):
    """The reversals of W runs.

    Attributes:
        t: Time of the latest tick, (1,), in [s].
        ticks: Number of ticks, (1,).
        u: Actuation at the latest three ticks, tick k at index k mod 3, (3, n, W); nan until there are three.
        reversals: Reversals in a row so far, (n, W).
        streak: Start, duration and amplitude of the current row, (3, n, W).
        going: Number of runs with a current row, (n,).
        episodes: Start, duration and amplitude of the reported episodes, (3, n, W); amplitude 0 for none.
    """

    t: Array
    ticks: Array
    u: Array
    reversals: Array
    streak: Array
    going: Array
    episodes: Array


def chatters_of(n: int, W: int, tiles: int) -> list[Chatter]:
    """Return empty records for `tiles` tiles of W runs, before their first tick."""
    t, ticks, going = np.zeros((tiles, 1)), np.zeros((tiles, 1), np.int64), np.zeros((tiles, n), np.int64)
    u, count = np.full((tiles, 3, n, W), np.nan), np.zeros((tiles, n, W), np.int64)
    streak, episodes = (np.zeros((tiles, 3, n, W)) for _ in range(2))
    return [Chatter(t[k], ticks[k], u[k], count[k], streak[k], going[k], episodes[k]) for k in range(tiles)]


def tick(of: Chatter, t: float, u: Array, low: Array, high: Array) -> None:
    """Record a tick at t with the actuation u (n, W), whose extremes so far are low and high (n, W)."""
    k = of.ticks[0]
    before, middle, now = of.u[(k + 1) % 3], of.u[(k + 2) % 3], of.u[k % 3]
    copy(now, u)
    for j in range(len(u)):
        if of.going[j] > 0 or turns(before[j], middle[j], now[j]):
            for b in range(u.shape[1]):
                change, next_change = middle[j, b] - before[j, b], now[j, b] - middle[j, b]
                if change * next_change < 0.0 or of.reversals[j, b] > 0:
                    count(of, j, b, t, change, next_change, low[:, b], high[:, b])
    of.t[0] = t
    of.ticks[0] = k + 1


def turns(before: Array, middle: Array, now: Array) -> bool:
    """Return True if the actuation (W,) of a joint reverses at the middle of three ticks in any run."""
    reverses = False
    for b in range(len(now)):
        reverses |= (middle[b] - before[b]) * (now[b] - middle[b]) < 0.0
    return reverses


def count(
    of: Chatter, j: int, b: int, t: float, change: float, next_change: float, low: Array, high: Array
) -> None:  # fmt: skip
    """Count a reversal of joint j in run b at the tick before t; end its row if the change is noise."""
    largest = 0.0
    for i in range(len(low)):
        largest = max(largest, high[i], -low[i])
    least = max(_PART * max(high[j], -low[j]), _LEAST * largest)
    if change * next_change < -(least**2):
        if of.reversals[j, b] == 0:
            of.going[j] += 1
            of.streak[0, j, b], of.streak[2, j, b] = of.t[0], 0.0
        of.reversals[j, b] += 1
        of.streak[1, j, b] = t - of.streak[0, j, b]
        of.streak[2, j, b] = max(of.streak[2, j, b], abs(change) / 2, abs(next_change) / 2)
    elif of.reversals[j, b] > 0:
        close(of, j, b)


def close(of: Chatter, j: int, b: int) -> None:
    """End a row of reversals; it is an episode if it is long enough."""
    if of.reversals[j, b] >= _REVERSALS:
        duration, amplitude, largest = of.streak[1, j, b], of.streak[2, j, b], of.episodes[2, j, b]
        if amplitude > _OTHER * largest:
            of.episodes[0, j, b], of.episodes[1, j, b], of.episodes[2, j, b] = of.streak[0, j, b], duration, amplitude
        elif amplitude > largest / _OTHER:
            of.episodes[1, j, b] += duration
            of.episodes[2, j, b] = max(largest, amplitude)
    of.reversals[j, b] = 0
    of.going[j] -= 1


def close_all(of: Chatter) -> None:
    """End all current rows after the last tick."""
    for j, b in np.argwhere(of.reversals > 0) if of.ticks[0] else ():
        close(of, j, b)
