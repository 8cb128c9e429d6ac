"""The schedule of a run: segments of time without ticks or switches inside, and the steps on each.

A companion run takes steps of another length on the same segments. Every step ends at a whole number of steps of the
run, or of parts of one, so that both pass common times.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import ceil
from typing import final

import numpy as np

from robot_dyn.foundations.errors import QueryError

MOST_CUT = 200_000  # steps of a run of fixed step that is cut at events
LEAST_STEPS = 3  # on a segment: fewer leave no room for a longer step
ULPS = 4  # times that differ by no more units in the last place are one
ON_STEP = 1e-9  # of step_s: a sample that lies so near to the end of a step is taken there
_ROUNDED = 1e-9  # of the period: k · period, as computed, is the time that the user wrote


@final
@dataclass(frozen=True)
class Segment:
    """A segment of the run without ticks or switches inside.

    Attributes:
        start: In [s].
        end: In [s].
        tick: Whether a sampled controller acts at its start.
        steps: Number of steps.
        first: Number of steps of the run, not of a companion, before its start.
        pace: Length of its steps, in steps of the run.
    """

    start: float
    end: float
    tick: bool
    steps: int = 1
    first: int = 0
    pace: Fraction = Fraction(1)


def cuts(
    duration_s: float, period_s: float, switches: Iterable[float], instants: tuple[float, ...] = (0.0,)
) -> list[tuple[float, bool]]:
    """Times at which segments start, and whether each is a tick; the last is the end of the run.

    A switch keeps its exact time. A tick, whose time is the rounded product k · period, moves onto a switch, or onto
    the end, that lies within rounding of it.

    Args:
        duration_s: Length of the run, in [s].
        period_s: Period of a sampled controller, in [s]; 0 for none.
        switches: Times at which something switches, in [s].
        instants: Parts of a period at which there is a tick, ascending from 0.

    Raises:
        QueryError: If two switches lie so close together that no segment fits between them.
    """
    inside = sorted({0.0, *(t for t in switches if 0.0 < t < duration_s - ULPS * np.spacing(duration_s))})
    for before, after in pairwise(inside):
        if after - before <= ULPS * np.spacing(after):
            raise QueryError(
                f"switches at {before!r} s and {after!r} s are {after - before:.1e} s apart, less than times of this "
                "size resolve: merge them, or move them apart"
            )
    count = ceil(duration_s / period_s - _ROUNDED) if period_s > 0 else 1
    ticks, fixed = (
        period_s * np.add.outer(np.arange(max(1, count) + 1), instants).ravel(),
        np.array([*inside, duration_s]),
    )
    nearest = near(fixed, ticks)
    ticks = np.where(np.abs(nearest - ticks) <= _ROUNDED * period_s + ULPS * np.spacing(nearest), nearest, ticks)
    acting = set(ticks[ticks <= duration_s].tolist()) if period_s > 0 else {0.0}
    return [(t, t in acting) for t in sorted({*inside, *acting, duration_s})]


def near(fixed: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The entry of ascending `fixed` nearest to each of t."""
    right = np.clip(np.searchsorted(fixed, t), 1, len(fixed) - 1)
    return np.where(t - fixed[right - 1] < fixed[right] - t, fixed[right - 1], fixed[right])


def steps_on(length: float, step_s: float, record_every_s: float) -> int:
    """Number of steps on a segment; where it holds whole record periods, each of them has the same number."""
    periods = round(length / record_every_s) if record_every_s else 0
    if periods and abs(length / record_every_s - periods) < _ROUNDED:
        return periods * max(1, ceil(record_every_s / step_s - _ROUNDED))
    return max(1, ceil(length / step_s - _ROUNDED))


def nodes(segments: tuple[Segment, ...]) -> np.ndarray:
    """Ends of all steps, the start among them, in [s]."""
    parts = [each.start + np.arange(each.steps) * ((each.end - each.start) / each.steps) for each in segments]
    return np.concatenate([*parts, [segments[-1].end]])


def mesh(segments: tuple[Segment, ...], pace: Fraction) -> np.ndarray:
    """Ends of steps `pace` times as long, a whole number or one over it; of the former each is one of `nodes`."""
    times = nodes(segments)
    if pace >= 1:
        firsts = np.array([each.first for each in segments])
        place = np.arange(len(times)) - firsts[np.searchsorted(firsts, np.arange(len(times)), side="right") - 1]
        return times[place % int(pace) == 0]
    parts = int(1 / pace)
    inside = times[:-1, None] + np.diff(times)[:, None] * (np.arange(parts) / parts)
    return np.append(inside.ravel(), times[-1])


def paced(segments: tuple[Segment, ...], pace: Fraction) -> tuple[Segment, ...]:
    """The schedule of a companion run, whose steps are `pace` times as long.

    A segment that does not hold a whole number of longer steps ends with one step of what is left.
    """
    if pace == 1:
        return segments
    result: list[Segment] = []
    for each in segments:
        whole = int(each.steps / pace)
        rest = each.steps - whole * pace
        middle = each.end if not rest else each.start + float(whole * pace) * (each.end - each.start) / each.steps
        if whole:
            result.append(Segment(each.start, middle, each.tick, whole, each.first, pace))
        if rest:
            result.append(Segment(middle, each.end, each.tick and not whole, 1, each.first + int(whole * pace), rest))
    return tuple(result)
