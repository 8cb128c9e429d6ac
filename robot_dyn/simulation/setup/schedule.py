"""The schedule of a run: segments of time without ticks or switches inside, and the steps of each segment.

A companion run takes longer or shorter steps on the same segments. The ratio of both steps is a whole number or one
over a whole number, so that run and companion reach common times.
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

MOST_CUT = 200_000  # steps of a run of fixed step whose steps may end at events
LEAST_STEPS = 3  # on a segment: with fewer, a companion run cannot take longer steps
ULPS = 4  # units in the last place: times that differ by at most these are equal
ON_STEP = 1e-9  # fraction of step_s: a sample this close to the end of a step is taken there
_ROUNDED = 1e-9  # fraction of the period: tolerance for the rounding of k · period


@final
@dataclass(frozen=True)
class Segment:
    """A segment of the run without ticks or switches inside.

    Attributes:
        start: Time at the start, in [s].
        end: Time at the end, in [s].
        tick: True if a sampled controller acts at the start.
        steps: Number of steps.
        first: Number of steps before the start, counted in steps of the run also for a companion.
        pace: Length of a step, in steps of the run.
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
    """Return the times at which segments start, with True for ticks; the last time is the end of the run.

    Switches keep their exact times. The time of a tick is the rounded product k · period: if a switch or the end of
    the run lies within rounding of it, the tick moves there.

    Args:
        duration_s: Length of the run, in [s].
        period_s: Period of a sampled controller, in [s]; 0 without one.
        switches: Times at which effects or references switch, in [s].
        instants: Times of the ticks within a period, as fractions of the period, ascending from 0.

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
    """Return the entry of the ascending array `fixed` that is nearest to each entry of t."""
    right = np.clip(np.searchsorted(fixed, t), 1, len(fixed) - 1)
    return np.where(t - fixed[right - 1] < fixed[right] - t, fixed[right - 1], fixed[right])


def steps_on(length: float, step_s: float, record_every_s: float) -> int:
    """Return the number of steps on a segment, at most a record period long each; whole periods have equal steps."""
    periods = round(length / record_every_s) if record_every_s else 0
    if periods and abs(length / record_every_s - periods) < _ROUNDED:
        return periods * max(1, ceil(record_every_s / step_s - _ROUNDED))
    return max(1, ceil(length / min(step_s, record_every_s or step_s) - _ROUNDED))


def nodes(segments: tuple[Segment, ...]) -> np.ndarray:
    """Return the start of the run and the ends of all its steps, in [s]."""
    parts = [x.start + np.arange(x.steps) * ((x.end - x.start) / x.steps) for x in segments]
    return np.concatenate([*parts, [segments[-1].end]])


def mesh(segments: tuple[Segment, ...], pace: Fraction) -> np.ndarray:
    """Return the ends of steps `pace` times as long, in [s]; if pace ≥ 1, each of them is one of `nodes`.

    pace is a whole number or one over a whole number.
    """
    times = nodes(segments)
    if pace >= 1:
        firsts = np.array([segment.first for segment in segments])
        place = np.arange(len(times)) - firsts[np.searchsorted(firsts, np.arange(len(times)), side="right") - 1]
        return times[place % int(pace) == 0]
    parts = int(1 / pace)
    inside = times[:-1, None] + np.diff(times)[:, None] * (np.arange(parts) / parts)
    return np.append(inside.ravel(), times[-1])


def paced(segments: tuple[Segment, ...], pace: Fraction) -> tuple[Segment, ...]:
    """Return the schedule of a companion run, whose steps are `pace` times as long.

    A segment that is not a whole number of longer steps ends with one shorter step.
    """
    if pace == 1:
        return segments
    result: list[Segment] = []
    for start, end, tick, steps, first in ((x.start, x.end, x.tick, x.steps, x.first) for x in segments):
        whole = int(steps / pace)
        rest = steps - whole * pace
        middle = end if not rest else start + float(whole * pace) * (end - start) / steps
        if whole:
            result.append(Segment(start, middle, tick, whole, first, pace))
        if rest:
            result.append(Segment(middle, end, tick and not whole, 1, first + int(whole * pace), rest))
    return tuple(result)
