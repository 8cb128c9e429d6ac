"""Samples of two publishers in one log: refused, because interleaved rows are not one motion."""

from __future__ import annotations

import numpy as np

from robot_dyn.control.samples.recorded import TWO_PUBLISHERS, Recorded
from robot_dyn.control.samples.turns import whole_turns
from robot_dyn.foundations.errors import PlanError

_FEW, _PART = 8, 0.1  # smallest number, and fraction of the samples, that are far from both neighbours
_APART = 0.01  # [rad] or [m]: smallest distance of the two motions, far above the resolution of encoders
_BACK = 0.2  # times the step to the other motion: the largest distance of the samples before and after it
_MIN_FRACTION = 0.8  # smallest fraction of fast steps that lead to the other motion or back
_SPEED = np.pi  # [rad/s] or [m/s], for joints without a velocity limit
_LAG = 2e-3  # [rad] or [m]: smallest step back of a delayed copy, above the resolution of encoders
_BEND = 0.2  # times that step: the largest second difference within each motion, which noise exceeds
_UNEVEN = 1.2  # ratio of alternate periods: clocks of two publishers are rarely half a period apart


def refuse_alternating(table: Recorded) -> None:
    """Raise a PlanError if a joint jumps back and forth between two motions, faster than it can move.

    Such a sample is far from the samples before and after it, which are near each other.
    """
    steps = np.diff(table.q, axis=0)
    limit = np.where(np.isfinite(table.limit), table.limit, _SPEED)
    fast = (np.abs(table.speed) > limit) & ~whole_turns(table)
    size = np.minimum(np.abs(steps[1:]), np.abs(steps[:-1]))
    apart = (fast[1:] | fast[:-1]) & (np.abs(steps[1:] + steps[:-1]) < _BACK * size) & (size > _APART)
    to_or_back = np.pad(apart, ((0, 1), (0, 0))) | np.pad(apart, ((1, 0), (0, 0)))
    interleaved = apart.sum(axis=0) >= max(_FEW, _PART * len(steps))
    interleaved &= (fast & to_or_back).sum(axis=0) >= _MIN_FRACTION * fast.sum(axis=0)
    delayed = _delayed(table, fast)
    copied = delayed.sum(axis=0) >= max(_FEW, _PART * len(steps))
    copied &= delayed.sum(axis=0) >= _MIN_FRACTION * (np.abs(steps[2:-1]) > _LAG).sum(axis=0)
    apart[1:-1] |= delayed & copied
    for i in np.flatnonzero((interleaved | copied) & table.has_column)[:1]:
        k = int(apart[:, i].argmax())
        q, unit = table.q[k : k + 3, i], table.unit(int(i))
        raise PlanError(
            f"two publishers appear to be interleaved: {table.arm.joint_names[i]} jumps back and forth at"
            f" {apart[:, i].sum()} of {len(table.t)} samples, first {q[0]:.4g}, {q[1]:.4g}, {q[2]:.4g} {unit} from"
            f" {table.t[k]:.6g} s; {TWO_PUBLISHERS}"
        )


def _delayed(table: Recorded, fast: np.ndarray) -> np.ndarray:
    """Return True where a sample belongs to a copy that is a few steps late, (m − 4, n), from the third on.

    The joint alternates between steps back and forward, while every other sample continues one smooth motion. Vibration
    and back-and-forth way points do the same at even periods, so steps must exceed the limits, or periods alternate.
    """
    q, gaps = table.q, np.diff(table.t)
    if len(q) < _FEW:
        return np.zeros((max(len(q) - 4, 0), q.shape[1]), bool)
    steps = np.diff(q, axis=0)
    before, after = steps[1:-2], steps[2:-1]
    size = np.minimum(np.abs(before), np.abs(after))
    bend = np.abs(q[4:] - 2 * q[2:-2] + q[:-4])
    odd, even = np.median(gaps[::2]), np.median(gaps[1::2])
    uneven = max(odd, even) > _UNEVEN * min(odd, even)
    returns = (before * after < 0) & (np.abs(before + after) >= _BACK * size)
    return returns & (size > _LAG) & (bend < _BEND * size) & (uneven | fast[1:-2] | fast[2:-1])
