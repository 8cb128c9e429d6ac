"""Chatter: actuation that reverses at every tick, (u⁺ − u)(u − u⁻) < 0 many times in a row.

Sampled damping chatters if its gain is too large for the period: v⁺ ≈ (1 − M⁻¹ kd T) v changes its sign at each tick
if an eigenvalue of M⁻¹ kd T is above 1, and grows if it is above 2. [Åström, Wittenmark, Computer-Controlled Systems,
3rd ed., 1997, ch. 2]

Plain functions of arrays (n, W) over joints and runs; both time loops call them at each tick.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.primitives import copy

_REVERSALS = 10  # smallest number in a row that is reported; well-sampled motion has fewer
_PART = 0.02  # fraction of the joint's largest actuation so far; smaller changes are noise
_LEAST = 1e-6  # fraction of the largest actuation of any joint so far; smaller changes are noise
_OTHER = 10.0  # ratio of amplitudes above which the smaller of two episodes is not reported


class Chatter(NamedTuple):
    """The reversals of W runs.

    Attributes:
        t: Time of the latest tick, (1,), in [s].
        ticks: Number of ticks, (1,).
        u: Actuation at the latest three ticks, tick k at index k mod 3, (3, n, W); nan where no tick has been yet.
        reversals: Reversals in a row so far, (n, W).
        streak: Start, duration and amplitude of the current row, (3, n, W).
        active_runs: Number of runs with a current row, (n,).
        episodes: Start of the first reported row of each joint, duration and amplitude of u in all reported rows,
            (3, n, W); amplitude 0 for none.
    """

    t: Array
    ticks: Array
    u: Array
    reversals: Array
    streak: Array
    active_runs: Array
    episodes: Array


def chatters_of(n: int, W: int, tiles: int) -> list[Chatter]:
    """Return empty records for `tiles` tiles of W runs, before their first tick."""
    t, ticks, going = np.zeros((tiles, 1)), np.zeros((tiles, 1), np.int64), np.zeros((tiles, n), np.int64)
    u, count = np.full((tiles, 3, n, W), np.nan), np.zeros((tiles, n, W), np.int64)
    streak, episodes = (np.zeros((tiles, 3, n, W)) for _ in range(2))
    return [Chatter(t[k], ticks[k], u[k], count[k], streak[k], going[k], episodes[k]) for k in range(tiles)]


def tick(chatter: Chatter, t: float, u: Array, low: Array, high: Array) -> None:
    """Record a tick at t with the actuation u (n, W), whose extremes so far are low and high (n, W)."""
    k = chatter.ticks[0]
    before, middle, now = chatter.u[(k + 1) % 3], chatter.u[(k + 2) % 3], chatter.u[k % 3]
    copy(now, u)
    for j in range(len(u)):
        if chatter.active_runs[j] > 0 or turns(before[j], middle[j], now[j]):
            for b in range(u.shape[1]):
                change, next_change = middle[j, b] - before[j, b], now[j, b] - middle[j, b]
                if change * next_change < 0.0 or chatter.reversals[j, b] > 0:
                    count(chatter, j, b, t, change, next_change, low[:, b], high[:, b])
    chatter.t[0] = t
    chatter.ticks[0] = k + 1


def turns(before: Array, middle: Array, now: Array) -> bool:
    """Return True if the actuation (W,) of a joint reverses at the middle of three ticks in any run."""
    reverses = False
    for b in range(len(now)):
        reverses |= (middle[b] - before[b]) * (now[b] - middle[b]) < 0.0
    return reverses


def count(
    chatter: Chatter, j: int, b: int, t: float, change: float, next_change: float, low: Array, high: Array
) -> None:  # fmt: skip
    """Count a reversal of joint j in run b at the tick before t; end its row if the change is noise."""
    largest = 0.0
    for i in range(len(low)):
        largest = max(largest, high[i], -low[i])
    least = max(_PART * max(high[j], -low[j]), _LEAST * largest)
    if change * next_change < -(least**2):
        if chatter.reversals[j, b] == 0:
            chatter.active_runs[j] += 1
            chatter.streak[0, j, b], chatter.streak[2, j, b] = chatter.t[0], 0.0
        chatter.reversals[j, b] += 1
        chatter.streak[1, j, b] = t - chatter.streak[0, j, b]
        chatter.streak[2, j, b] = max(chatter.streak[2, j, b], abs(change) / 2, abs(next_change) / 2)
    elif chatter.reversals[j, b] > 0:
        close(chatter, j, b)


def close(chatter: Chatter, j: int, b: int) -> None:
    """End a row of reversals; it is an episode if it is long enough."""
    if chatter.reversals[j, b] >= _REVERSALS:
        duration, amplitude, largest = chatter.streak[1, j, b], chatter.streak[2, j, b], chatter.episodes[2, j, b]
        if amplitude > _OTHER * largest:
            chatter.episodes[0, j, b], chatter.episodes[1, j, b], chatter.episodes[2, j, b] = (
                chatter.streak[0, j, b],
                duration,
                amplitude,
            )
        elif amplitude > largest / _OTHER:
            chatter.episodes[1, j, b] += duration
            chatter.episodes[2, j, b] = max(largest, amplitude)
    chatter.reversals[j, b] = 0
    chatter.active_runs[j] -= 1


def close_all(chatter: Chatter) -> None:
    """End all current rows after the last tick."""
    for j, b in np.argwhere(chatter.reversals > 0) if chatter.ticks[0] else ():
        close(chatter, j, b)
