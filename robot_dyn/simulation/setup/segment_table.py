"""The segments of a run as arrays: its segments, their steps, and what the state equation is given on each.

p = (first and last time of the segment, t₀, c₀, c₁, …)   with q_d(t) = Σⱼ c_j (t − t₀)ʲ on the segment, one polynomial
of the references after the other; at one time, of a tick or of the end, the first terms of Taylor's series there
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from robot_dyn.control.controller import Controller
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.values import cached
from robot_dyn.simulation.setup.schedule import paced
from robot_dyn.simulation.setup.setup import Setup

_MOST_CACHED = 1000  # segments: to compute more of them takes little of the time of their run, to cache them memory
BOUNDS = 2  # numbers of p before the reference: time is held between them, so that switches act as between them


class SegmentTable(NamedTuple):
    """Segments without ticks or switches inside, S of them; the last is the end of the run, of no length.

    Attributes:
        starts, lengths: When it starts and its step, (S,), in [s].
        counts, ticks: Its steps, and the number, from 1, of the tick of a sampled controller at its start, or 0, (S,).
        payload_events: 1 where a payload is picked up or dropped at its start, (S,).
        parameters: p of the state equation on it, (S, P).
        at_ticks: The same at its start alone.
    """

    starts: Array
    lengths: Array
    counts: Array
    ticks: Array
    payload_events: Array
    parameters: Array
    at_ticks: Array


def segment_table(setup: Setup, pace: Fraction = Fraction(1)) -> SegmentTable:
    """The segments of a setup, with steps `pace` times as long, and its end, for one run, which changes it."""
    if pace != 1 or len(setup.segments) > _MOST_CACHED:
        return table_of(setup, pace)
    table = cached(setup, table_of)
    return table._replace(ticks=table.ticks.copy(), payload_events=table.payload_events.copy())


def table_of(setup: Setup, pace: Fraction = Fraction(1)) -> SegmentTable:
    """Return the segments of a setup with steps `pace` times as long."""
    segments = paced(setup.segments, pace)
    counts = np.array([each.steps for each in segments])
    starts, ends = (np.array([getattr(each, name) for each in segments]) for name in ("start", "end"))
    ticks = np.array([*(each.tick for each in segments), setup.ends_on_tick]) & setup.equation.sampled
    bounds = np.column_stack([np.nextafter(starts, np.inf), np.nextafter(ends, -np.inf)])
    followed = polynomials(setup.controller)
    inside = np.hstack([bounds, *(_pieces(each, starts, ends) for each in followed)])
    starts = np.append(starts, setup.duration_s)
    unbounded = np.broadcast_to([-np.inf, np.inf], (len(starts), BOUNDS))
    at_ticks = np.ascontiguousarray(np.hstack([unbounded, *(_at_times(each, starts) for each in followed)]))
    return SegmentTable(
        starts,
        np.append((ends - starts[:-1]) / counts, 0.0),
        np.append(counts, 1).astype(np.int64),
        np.where(ticks, np.cumsum(ticks), 0),
        np.append(np.isin(starts[:-1], _payload_events(setup)), False).astype(np.int64),
        np.vstack([inside, at_ticks[-1:]]),
        at_ticks,
    )


def _payload_events(setup: Setup) -> list[float]:
    """Times after the start at which payloads are picked up or dropped, in [s]."""
    payloads = setup.plant.equation_of_motion.payloads
    return [t for each in payloads for t in each.switches if t > 0]


def polynomials(controller: Controller | None) -> tuple[PiecewisePolynomial, ...]:
    """The polynomials of the references of a controller."""
    references = () if controller is None else controller.references.values()
    return tuple(each for reference in references for each in reference.polynomials.values())


def lengths(followed: PiecewisePolynomial) -> int:
    """How many numbers define one of its pieces: t₀ and the coefficients."""
    return 1 + followed.coefficients[0].size


def _at_times(reference: PiecewisePolynomial, t: np.ndarray) -> np.ndarray:
    """A reference near each of some times: t₀ = t and the coefficients of its value and derivatives there, (m, P)."""
    q, v, a = reference.at(t)
    table = np.zeros((len(t), *reference.coefficients.shape[1:]))
    for j, x in zip(range(len(reference.coefficients[0])), (q, v, a / 2), strict=False):
        table[:, j] = x
    return np.column_stack([t, table.reshape(len(t), -1)])


def _pieces(reference: PiecewisePolynomial, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """The polynomial that a reference is on each segment: t₀ and its coefficients, (S, P)."""
    breaks, middle = reference.breaks, (starts + ends) / 2
    piece = np.searchsorted(breaks[1:-1], middle, side="right")
    table = reference.coefficients[piece].copy()
    rests = (middle < breaks[0]) | (middle > breaks[-1])
    table[rests, 0], table[rests, 1:] = reference.at(middle[rests])[0], 0.0
    return np.column_stack([breaks[piece], table.reshape(len(middle), -1)])
