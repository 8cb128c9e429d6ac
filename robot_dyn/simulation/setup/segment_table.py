"""The segments of a run as arrays: times, steps, and the parameters p of the state equation on each segment.

    p = (first and last time of the segment, t₀, c₀, c₁, …),   q_d(t) = Σⱼ c_j (t − t₀)ʲ on the segment

t₀ and c are repeated for each polynomial of the references. For the equation at one time, that of a tick or of the end,
c are the first terms of the Taylor series of q_d there.
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

_MOST_CACHED = 1000  # segments of a cached table: more take memory, and computing them takes little of a run's time
BOUNDS = 2  # leading numbers of p: t is clipped to lie between them, so that no switch at an end acts inside


class SegmentTable(NamedTuple):
    """S segments without ticks or switches inside; the last one is the end of the run and has length 0.

    Attributes:
        starts, lengths: Start of each segment, and length of its steps, in [s], (S,).
        counts: Number of steps on it, (S,).
        ticks: Number, from 1, of the tick of a sampled controller at its start; 0 if there is no tick, (S,).
        payload_events: 1 if a payload is picked up or dropped at its start, else 0, (S,).
        parameters: p of the state equation on the segment, (S, P).
        at_ticks: p at its start only, (S, P).
    """

    starts: Array
    lengths: Array
    counts: Array
    ticks: Array
    payload_events: Array
    parameters: Array
    at_ticks: Array


def segment_table(setup: Setup, pace: Fraction = Fraction(1)) -> SegmentTable:
    """Return the segments of a setup with steps `pace` times as long, as arrays that a run may change."""
    if pace != 1 or len(setup.segments) > _MOST_CACHED:
        return table_of(setup, pace)
    table = cached(setup, table_of)
    return table._replace(ticks=table.ticks.copy(), payload_events=table.payload_events.copy())


def table_of(setup: Setup, pace: Fraction = Fraction(1)) -> SegmentTable:
    """Return the segments of a setup with steps `pace` times as long."""
    segments = paced(setup.segments, pace)
    counts = np.array([segment.steps for segment in segments])
    starts, ends = np.array([(segment.start, segment.end) for segment in segments]).T
    ticks = np.array([*(segment.tick for segment in segments), setup.ends_on_tick]) & setup.equation.sampled
    bounds = np.column_stack([np.nextafter(starts, np.inf), np.nextafter(ends, -np.inf)])
    references = polynomials(setup.controller)
    inside = np.hstack([bounds, *(_pieces(x, starts, ends) for x in references)])
    starts = np.append(starts, setup.duration_s)
    unbounded = np.broadcast_to([-np.inf, np.inf], (len(starts), BOUNDS))
    at_ticks = np.ascontiguousarray(np.hstack([unbounded, *(_at_times(x, starts) for x in references)]))
    return SegmentTable(
        starts=starts,
        lengths=np.append((ends - starts[:-1]) / counts, 0.0),
        counts=np.append(counts, 1).astype(np.int64),
        ticks=np.where(ticks, np.cumsum(ticks), 0),
        payload_events=np.append(np.isin(starts[:-1], _payload_events(setup)), False).astype(np.int64),
        parameters=np.vstack([inside, at_ticks[-1:]]),
        at_ticks=at_ticks,
    )


def _payload_events(setup: Setup) -> list[float]:
    """Return the times after the start at which payloads are picked up or dropped, in [s]."""
    payloads = setup.plant.equation_of_motion.payloads
    return [t for payload in payloads for t in payload.switches if t > 0]


def polynomials(controller: Controller | None) -> tuple[PiecewisePolynomial, ...]:
    """Return the polynomials of the references of a controller."""
    references = () if controller is None else controller.references.values()
    return tuple(x for reference in references for x in reference.polynomials.values())


def lengths(polynomial: PiecewisePolynomial) -> int:
    """Return the number of numbers that define a piece: t₀ and the coefficients."""
    return 1 + polynomial.coefficients[0].size


def _at_times(reference: PiecewisePolynomial, t: np.ndarray) -> np.ndarray:
    """Return the Taylor polynomials of a reference at the times t: t₀ = t and q_d, q̇_d, q̈_d/2 there, (len(t), P)."""
    q, v, a = reference.at(t)
    table = np.zeros((len(t), *reference.coefficients.shape[1:]))
    for j, x in zip(range(len(reference.coefficients[0])), (q, v, a / 2), strict=False):
        table[:, j] = x
    return np.column_stack([t, table.reshape(len(t), -1)])


def _pieces(reference: PiecewisePolynomial, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the polynomial of a reference on each segment: t₀ and the coefficients, (S, P)."""
    breaks, middle = reference.breaks, (starts + ends) / 2
    piece = np.searchsorted(breaks[1:-1], middle, side="right")
    table = reference.coefficients[piece].copy()
    rests = (middle < breaks[0]) | (middle > breaks[-1])
    table[rests, 0], table[rests, 1:] = reference.at(middle[rests])[0], 0.0
    return np.column_stack([breaks[piece], table.reshape(len(middle), -1)])
