"""The timetable of a run as arrays: its stretches, their steps, and the polynomial that a reference is on each.

q_d(t) = Σⱼ c_j (t − t₀)ʲ  on a stretch;  at one time, of a tick or a sample, the first terms of Taylor's series
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, final

import numpy as np

from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.simulation.schedule import paced
from robot_dyn.simulation.setup import Setup


@final
@dataclass(frozen=True, eq=False)
class Timetable:
    """Stretches of a run, S of them.

    Attributes:
        starts, lengths, lasts: When it starts, its step, and the last time that belongs to it, (S,), in [s].
        counts, ticks: Its steps, and 1 where a sampled controller acts at its start, (S,).
        pieces: t₀ and coefficients of the reference, (S, P).
        at_ticks: The same of the reference at its start alone.
    """

    starts: np.ndarray
    lengths: np.ndarray
    lasts: np.ndarray
    counts: np.ndarray
    ticks: np.ndarray
    pieces: np.ndarray
    at_ticks: np.ndarray

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """Its arrays, in this order."""
        return self.starts, self.lengths, self.lasts, self.counts, self.ticks, self.pieces, self.at_ticks

    def time(self, stretch: int, step: int) -> float:
        """Time of a step, in [s]."""
        return float(self.starts[stretch] + step * self.lengths[stretch])


def timetable(setup: Setup, pace: Fraction = Fraction(1), end: bool = False) -> Timetable:
    """The stretches of a setup, with steps `pace` times as long.

    Args:
        setup: What to run.
        pace: Length of a step, in steps of the setup.
        end: Whether the end of the run is one stretch more, of no length.
    """
    stretches = paced(setup.stretches, pace)
    counts = np.array([each.steps for each in stretches])
    starts, ends = (np.array([getattr(each, name) for each in stretches]) for name in ("start", "end"))
    lengths = (ends - starts) / counts
    lasts, ticks = np.nextafter(ends, -np.inf), np.array([each.tick for each in stretches])
    reference: Any = getattr(setup.controller, "reference", None)
    on_stretches, at_ticks = pieces(setup.controller, starts, ends), at_times(reference, starts)
    if end:
        last = np.array([setup.duration_s])
        starts, lengths, lasts = np.append(starts, last), np.append(lengths, 0.0), np.append(lasts, last)
        counts, ticks = np.append(counts, 1), np.append(ticks, setup.controller is not None)
        there = at_times(reference, last)
        on_stretches, at_ticks = np.vstack([on_stretches, there]), np.vstack([at_ticks, there])
    return Timetable(starts, lengths, lasts, counts.astype(np.int64), ticks.astype(np.int64), on_stretches, at_ticks)


def at_times(reference: Any, t: np.ndarray) -> np.ndarray:
    """A reference near each of some times: t₀ = t and the coefficients of its value and derivatives there, (m, P)."""
    if not isinstance(reference, PiecewisePolynomial):
        return np.zeros((len(t), 0))
    q, v, a = reference.at(t)
    table = np.zeros((len(t), *reference.coefficients.shape[1:]))
    for j, x in zip(range(len(reference.coefficients[0])), (q, v, a / 2), strict=False):
        table[:, j] = x
    return np.column_stack([t, table.reshape(len(t), -1)])


def pieces(controller: Any, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """The polynomial that a controller's reference is on each stretch: t₀ and its coefficients, (S, P)."""
    reference = getattr(controller, "reference", None)
    if not isinstance(reference, PiecewisePolynomial):
        return np.zeros((len(starts), 0))
    breaks, middle = reference.breaks, (starts + ends) / 2
    piece = np.searchsorted(breaks[1:-1], middle, side="right")
    table = reference.coefficients[piece].copy()
    rests = (middle < breaks[0]) | (middle > breaks[-1])
    table[rests, 0], table[rests, 1:] = reference.at(middle[rests])[0], 0.0
    return np.column_stack([breaks[piece], table.reshape(len(middle), -1)])
