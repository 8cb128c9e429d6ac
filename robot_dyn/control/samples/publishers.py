"""Samples of two publishers in one log: refused, because their rows interleave and belong to no single motion."""

from __future__ import annotations

import numpy as np

from robot_dyn.control.samples.recorded import TWO_PUBLISHERS, Recorded
from robot_dyn.control.samples.turns import whole_turns
from robot_dyn.foundations.errors import PlanError

_FEW, _PART = 8, 0.1  # smallest number, and fraction of the samples, that stand apart from both neighbours
_APART = 0.01  # [rad] or [m]: smallest distance of the two motions, far above the resolution of encoders
_BACK = 0.2  # times the step to the other motion: the largest distance of the samples before and after it
_MOST = 0.8  # smallest fraction of fast steps that lead to the other motion or back
_SPEED = np.pi  # [rad/s] or [m/s], for joints without a velocity limit


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
    interleaved &= (fast & to_or_back).sum(axis=0) >= _MOST * fast.sum(axis=0)
    for i in np.flatnonzero(interleaved & table.has_column)[:1]:
        k = int(apart[:, i].argmax())
        q, unit = table.q[k : k + 3, i], table.unit(int(i))
        raise PlanError(
            f"two publishers appear to be interleaved: {table.arm.joint_names[i]} jumps back and forth at"
            f" {apart[:, i].sum()} of {len(table.t)} samples, first {q[0]:.4g}, {q[1]:.4g}, {q[2]:.4g} {unit} from"
            f" {table.t[k]:.6g} s; {TWO_PUBLISHERS}"
        )
