"""What happened in a run, row by row as numbers; plain functions of these, for the loop.

A row is (t, number, `What`, side, direction, q, v), v as y has it. It becomes an `Occurrence` behind the loop.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array

CHATTER = 20  # events of one threshold, in next to no time
_ROOM = 64  # rows before the loop returns


class What(IntEnum):
    """What happens: to a coordinate of what may hold joints; or that a switching function passes its level."""

    STRIKES = 0  # a stop
    RESTS_AT_LAST = 1  # at a stop, behind bounces
    STICKS = 2
    RESTS = 3  # at a stop
    SLIDES = 4
    LEAVES = 5  # a stop
    REVERSES = 6
    PASSES = 7  # of this number among thresholds and user-defined events


class EventLog(NamedTuple):
    """What happened since the loop was called.

    Attributes:
        rows: The rows, (R, 5 + 2n).
        filled: How many are filled, (1,).
        room: How many there may be at an event; one event may fill those behind, too.
        latest, total: Times of the latest events, (CHATTER,), and how many there have been, (1,).
        brief: The time in which so many are looked at by Python: one threshold may chatter.
    """

    rows: Array
    filled: Array
    room: int
    latest: Array
    total: Array
    brief: float


def event_log(n: int, at_once: int, brief: float) -> EventLog:
    """An empty one of n joints, for so many rows at one event."""
    rows = np.zeros((_ROOM + at_once, 5 + 2 * n))
    return EventLog(rows, np.zeros(1, np.int64), _ROOM, np.zeros(CHATTER), np.zeros(1, np.int64), brief)


def note(log: EventLog, t: float, y: Array, number: int, what: int, side: float, direction: float) -> None:
    """Keep what happened."""
    row = log.rows[log.filled[0]]
    row[0], row[1], row[2], row[3], row[4] = t, float(number), float(what), side, direction
    for j in range(len(row) - 5):
        row[5 + j] = y[j, 0]
    log.filled[0] += 1
    remember_time(log, t)


def remember_time(log: EventLog, t: float) -> None:
    """Keep the time of an event."""
    log.latest[log.total[0] % len(log.latest)] = t
    log.total[0] += 1


def may_chatter(log: EventLog, t: float) -> bool:
    """Whether the latest events, with one at t, came in next to no time."""
    last = len(log.latest)
    oldest: int = (log.total[0] + 1) % last
    return log.total[0] + 1 >= last and t - log.latest[oldest] <= log.brief
