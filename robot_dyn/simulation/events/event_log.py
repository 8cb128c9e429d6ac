"""The log of the events in a loop, row by row as numbers; plain functions of arrays.

A row is (t, number, `EventKind`, side, direction, q, v), with v as y has it. It becomes an `Occurrence` after the loop.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array

CHATTER = 20  # latest events; they chatter if all are of one joint, within a very short time
_ROWS = 64  # before the loop returns


class EventKind(IntEnum):
    """The kind of an event at a joint that may be held, or at a switching function that passes its level."""

    STRIKES = 0  # a stop
    RESTS_AT_LAST = 1  # at a stop, after bounces
    STICKS = 2
    RESTS = 3  # at a stop
    SLIDES = 4
    LEAVES = 5  # a stop
    REVERSES = 6
    PASSES = 7  # its level; the number is among thresholds and user-defined events


class EventLog(NamedTuple):
    """The events since the loop was called.

    Attributes:
        rows: The rows, (R, 5 + 2n).
        filled: Number of rows in use, (1,).
        limit: Number of rows from which on the loop returns; one event may write further rows.
        latest, total: Times of the latest events, (CHATTER,), and number of all events, (1,).
        brief: Time in which CHATTER events may be chatter of a threshold, which Python handles, in [s].
    """

    rows: Array
    filled: Array
    limit: int
    latest: Array
    total: Array
    brief: float


def event_log(n: int, at_once: int, brief: float) -> EventLog:
    """Return an empty log for n joints, with up to `at_once` rows for one event."""
    return EventLog(
        rows=np.zeros((_ROWS + at_once, 5 + 2 * n)),
        filled=np.zeros(1, np.int64),
        limit=_ROWS,
        latest=np.zeros(CHATTER),
        total=np.zeros(1, np.int64),
        brief=brief,
    )


def log_event(log: EventLog, t: float, y: Array, number: int, kind: int, side: float, direction: float) -> None:
    """Write a row."""
    row = log.rows[log.filled[0]]
    row[0], row[1], row[2], row[3], row[4] = t, float(number), float(kind), side, direction
    for j in range(len(row) - 5):
        row[5 + j] = y[j, 0]
    log.filled[0] += 1
    log_time(log, t)


def log_time(log: EventLog, t: float) -> None:
    """Write the time of an event."""
    log.latest[log.total[0] % len(log.latest)] = t
    log.total[0] += 1


def may_chatter(log: EventLog, t: float) -> bool:
    """Return True if the latest events, with one at t, lie within a very short time."""
    last = len(log.latest)
    oldest: int = (log.total[0] + 1) % last
    return log.total[0] + 1 >= last and t - log.latest[oldest] <= log.brief
