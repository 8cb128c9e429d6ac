"""Whole turns in recorded angles: detection, and angles unwrapped across them.

A driver that reports angles between −π and π subtracts a whole turn when a joint passes π. Such a step is longer than
half a turn; without the whole turn it is as long as its neighbours. Angles are unwrapped only if the joint is
continuous and all its samples lie within one turn; otherwise the recorded motion may be intended.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from robot_dyn.control.samples.recorded import Recorded

_WITHIN = 2 * np.pi + 1e-3  # [rad]: one turn, with ends rounded to 3 decimals
_LIKE = 0.1  # [rad]: allowed difference of a step without its turn from its neighbours, plus twice their size
_MAX = np.pi / 2  # [rad]: upper bound of that difference
_FAST = 1.5  # times the velocity limit: the largest speed of a step without its turn


@final
@dataclass(frozen=True, eq=False)
class Turns:
    """Samples after a search for whole turns.

    Attributes:
        recorded: The samples as they were recorded.
        table: The samples with unwrapped angles.
        steps: True for recorded steps that are off by a whole turn, (m − 1, n).
        unclear: True for steps of ambiguous direction, of joints recorded within one turn, (m − 1, n).
        joined: True for joints whose angles were unwrapped, (n,).
    """

    recorded: Recorded
    table: Recorded
    steps: np.ndarray
    unclear: np.ndarray
    joined: np.ndarray


def joined_turns(recorded: Recorded) -> Turns:
    """Unwrap the angles of continuous joints where whole turns are certain; return the result of the search."""
    steps, moved = whole_turns(recorded), np.diff(recorded.q, axis=0)
    continuous = np.array([kind == "continuous" for kind in recorded.arm.joint_types])
    within = continuous & (np.ptp(recorded.q, axis=0) <= _WITHIN)
    within &= not recorded.more  # velocities determine the motion between samples
    unclear = within & (np.abs(moved) > np.pi) & ~steps
    joined = within & steps.any(axis=0) & ~unclear.any(axis=0)
    turns = np.cumsum(np.sign(moved) * steps * joined, axis=0)
    q = recorded.q - 2 * np.pi * np.concatenate([np.zeros((1, len(joined))), turns])
    return Turns(recorded, replace(recorded, q=q), steps, unclear, joined)


def whole_turns(table: Recorded) -> np.ndarray:
    """Return True for steps of angles that are off by a whole turn, (m − 1, n).

    Without the turn such a step is similar to a neighbouring step at the same pace, or short if its neighbours are
    short; with the turn it is not.
    """
    moved, dt = np.diff(table.q, axis=0), table.dt[:, None]
    count = np.round(moved / (2 * np.pi))
    short = moved - 2 * np.pi * count
    left, right = _neighbours(short, dt)
    pace = np.nan_to_num(np.fmax(np.abs(left), np.abs(right)))
    off = np.fmin(np.abs(short - left), np.abs(short - right))
    off = np.fmin(off, np.where(pace < _MAX, np.abs(short), np.inf))
    as_recorded = np.fmin(*(np.nan_to_num(np.abs(moved - step), nan=np.inf) for step in _neighbours(moved, dt)))
    like = (off <= np.minimum(_LIKE + 2 * pace, _MAX)) & (off < as_recorded / 2)
    angles = np.array([kind != "prismatic" for kind in table.arm.joint_types])
    return angles & (np.abs(moved) > np.pi) & (np.abs(count) == 1) & like & (np.abs(short) <= _FAST * table.limit * dt)


def _neighbours(steps: np.ndarray, dt: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the steps that the previous and the next pace would give, both (m − 1, n); nan at the ends."""
    pace = np.pad(steps / dt, ((1, 1), (0, 0)), constant_values=np.nan)
    return pace[:-2] * dt, pace[2:] * dt
