"""Whole turns in recorded angles: which steps are one, and angles joined across them.

A driver that reports angles between −π and π subtracts a whole turn where a joint turns on through π. Such a step is
longer than half a turn, and without the turn it is as long as the steps next to it. Angles are joined only where the
joint is continuous and all its samples lie within one turn; elsewhere the recorded motion may be meant.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from robot_dyn.control.samples.recorded import Recorded

_WITHIN = 2 * np.pi + 1e-3  # [rad]: one turn, with ends that were rounded to 3 decimals
_LIKE = 0.1  # [rad], and twice the steps next to it: how far a step without its turn may be from those
_MOST = np.pi / 2  # [rad], of the same
_FAST = 1.5  # times the velocity limit: a step without its turn is no faster


@final
@dataclass(frozen=True, eq=False)
class Turns:
    """Samples that were searched for whole turns.

    Attributes:
        recorded: The samples as they were recorded.
        table: The same with joined angles.
        steps: Whether a step of the recorded samples is off by a whole turn, (m − 1, n).
        unclear: Whether a step of a joint recorded within one turn may have gone either way, (m − 1, n).
        joined: Whether the angles of a joint were joined, (n,).
    """

    recorded: Recorded
    table: Recorded
    steps: np.ndarray
    unclear: np.ndarray
    joined: np.ndarray


def joined_turns(recorded: Recorded) -> Turns:
    """Return the samples with the angles of continuous joints joined across whole turns, where these are certain."""
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
    """Return which steps of angles are off by a whole turn, (m − 1, n).

    Without the turn such a step is like one of the steps next to it, at their pace, or short if these are; with it, it
    is not.
    """
    moved, dt = np.diff(table.q, axis=0), table.dt[:, None]
    count = np.round(moved / (2 * np.pi))
    short = moved - 2 * np.pi * count
    left, right = _beside(short, dt)
    pace = np.nan_to_num(np.fmax(np.abs(left), np.abs(right)))
    off = np.fmin(np.abs(short - left), np.abs(short - right))
    off = np.fmin(off, np.where(pace < _MOST, np.abs(short), np.inf))
    as_recorded = np.fmin(*(np.nan_to_num(np.abs(moved - step), nan=np.inf) for step in _beside(moved, dt)))
    like = (off <= np.minimum(_LIKE + 2 * pace, _MOST)) & (off < as_recorded / 2)
    angles = np.array([kind != "prismatic" for kind in table.arm.joint_types])
    return angles & (np.abs(moved) > np.pi) & (np.abs(count) == 1) & like & (np.abs(short) <= _FAST * table.limit * dt)


def _beside(steps: np.ndarray, dt: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the steps before and after each one at their pace, (m − 1, n) each; nan where there is none."""
    pace = np.pad(steps / dt, ((1, 1), (0, 0)), constant_values=np.nan)
    return pace[:-2] * dt, pace[2:] * dt
