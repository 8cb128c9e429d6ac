"""Switching functions that may pass their levels within a step: for one run, and for W runs in lock step.

A coordinate of y is enclosed by Hermite's polynomial through values and rates at both ends of the step, in Bernstein's
form. Any other function is judged by its latest changes. [Shampine, Thompson 2000] Steps in lock step have no dense
output to locate an event: a run that may pass a level is repeated as a single run.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.integrator import States
from robot_dyn.integrate.primitives import copy, evaluate
from robot_dyn.simulation.dynamics.loop_state import Functions

FASTEST = 1e6  # [rad/s] or [m/s]: error control would follow an exploding state forever
_MARGIN = 4.0  # times the change of a limited actuation in a step, or in the one before
_STEADY = 0.5  # fraction of a rate: a smaller change of it within a step does not turn it


class LaneEvents(NamedTuple):
    """The switching functions of W runs in lock step: E coordinates of y, then functions of the actuation, K in all.

    Attributes:
        rows: Entry of y, and then of the values of the functions, (K,).
        coordinates: E.
        positions: Number of positions, whose accelerations y' contains; 0 if y has momenta.
        levels: The level of each run, (K, W); inf if it has none.
        sides: 1 above its level, −1 below; 0 before the first step, (K, W).
        rate, next_rate: y' at the start and at the end of a step, (m, W).
        values, next_values: Values of the F functions there, (F, W).
        change: Their change in the step before, (F, W).
        until: Start of the first step in which a run may pass a level; inf without one, (W,), in [s].
        left: Number of runs that are not marked, (1,).
    """

    rows: Array
    coordinates: int
    positions: int
    levels: Array
    sides: Array
    rate: Array
    next_rate: Array
    values: Array
    next_values: Array
    change: Array
    until: Array
    left: Array


class DetectingWork(NamedTuple):
    """The arrays of a step in lock step.

    Attributes:
        method: Arrays of the method, see `FixedStepper.work`.
        K: Rates of the method, the latest last.
        events: The switching functions.
    """

    method: NamedTuple
    K: Array
    events: LaneEvents


def enclosure(x0: float, x1: float, d0: float, d1: float, h: float) -> tuple[float, float]:
    """Return bounds of the cubic through two values and rates."""
    a, b = x0 + h * d0 / 3, x1 - h * d1 / 3
    return min(x0, x1, a, b), max(x0, x1, a, b)


def enclosure_of_position(
    x0: float, x1: float, d0: float, d1: float, a0: float, a1: float, h: float
) -> tuple[float, float]:
    """Return bounds of the polynomial of degree 5 through two positions, velocities and accelerations."""
    a, b = x0 + h * d0 / 5, x1 - h * d1 / 5
    c, d = x0 + 2 * h * d0 / 5 + h * h * a0 / 20, x1 - 2 * h * d1 / 5 + h * h * a1 / 20
    return min(x0, x1, a, b, c, d), max(x0, x1, a, b, c, d)


def coordinate_nears(low: float, high: float, level: float, side: float) -> bool:
    """Return True if a coordinate within these bounds may pass its level, with their distance as a margin."""
    margin = high - low
    if side > 0:
        return not low - margin > level
    return not high + margin < level


def function_nears(x0: float, x1: float, change: float, level: float, side: float) -> bool:
    """Return True if a function may pass its level in a step from x0 to x1; it changed by `change` in the last one."""
    margin = _MARGIN * max(abs(x1 - x0), change)
    return not min(side * (x0 - level), side * (x1 - level)) > margin


def leaves(x0: float, d0: float, d1: float, low: float, high: float, level: float, side: float) -> bool:
    """Return True if a coordinate that starts on its side, or on the level, only moves away, at a steady rate.

    Then the stages of the step evaluate the formula of that side alone.
    """
    on_side = side * (x0 - level) >= 0.0 and (low if side > 0 else high) == x0
    return on_side and side * d0 > 0.0 and abs(d1 - d0) <= _STEADY * abs(d0)


@cache
def detecting(step: Callable[..., int]) -> Callable[..., int]:
    """Return the step of a method in lock step that also marks the runs that may pass a level, or move without bound.

    Once all are marked, no step is taken.
    """

    def detecting_step(f: Functions, c: Any, work: DetectingWork, t: float, h: float, x: States) -> int:
        events = work.events
        if events.left[0] == 0:
            copy(x.after, x.y)
            return 0
        if t <= x.p[0]:  # the first step of a segment: the controller may have acted
            start(f, events, t, x)
        evaluations = step(f, c, work.method, t, h, x)
        return evaluations + detect(f, events, t, h, x)

    return detecting_step


def start(f: Functions, events: LaneEvents, t: float, x: States) -> None:
    """Evaluate rates and functions at the start of a segment, and the sides at the start of the run."""
    E = events.coordinates
    if E > 0:
        evaluate(f.rate, t, x.y, x.p, x.run_parameters, events.rate)
    if len(events.values) > 0:
        evaluate(f.events, t, x.y, x.p, x.run_parameters, events.values)
    for e in range(len(events.rows)):
        row = events.rows[e]
        for b in range(len(events.until)):
            if events.sides[e, b] == 0.0:
                value = x.y[row, b] if e < E else events.values[row, b]
                events.sides[e, b] = np.sign(value - events.levels[e, b])
                if value == events.levels[e, b] and e < E:  # on the level itself, the direction of motion counts
                    events.sides[e, b] = np.sign(events.rate[row, b])


def detect(f: Functions, events: LaneEvents, t: float, h: float, x: States) -> int:
    """Mark the runs that may pass a level in the step from y to y⁺, or move without bound; return evaluations."""
    E, n, y, after = events.coordinates, events.positions, x.y, x.after
    d0, d1, x0, x1 = events.rate, events.next_rate, events.values, events.next_values
    if E > 0:
        evaluate(f.rate, t + h, after, x.p, x.run_parameters, d1)
    if len(x0) > 0:
        evaluate(f.events, t + h, after, x.p, x.run_parameters, x1)
    for e in range(len(events.rows)):
        row = events.rows[e]
        for b in range(len(events.until)):
            level, side = events.levels[e, b], events.sides[e, b]
            if e < E:
                a, c, v, w = y[row, b], after[row, b], d0[row, b], d1[row, b]
                if row < n:
                    low, high = enclosure_of_position(a, c, v, w, d0[n + row, b], d1[n + row, b], h)
                else:
                    low, high = enclosure(a, c, v, w, h)
                if coordinate_nears(low, high, level, side) and not leaves(a, v, w, low, high, level, side):
                    mark(events, b, t)
            elif function_nears(x0[row, b], x1[row, b], events.change[row, b], level, side):
                mark(events, b, t)
    for e in range(n, 2 * n):
        for b in range(len(events.until)):
            if not abs(after[e, b]) < FASTEST:
                mark(events, b, t)
    for i in range(len(x0)):
        for b in range(len(events.until)):
            events.change[i, b] = abs(x1[i, b] - x0[i, b])
    copy(d0, d1)
    copy(x0, x1)
    return 1 if E > 0 else 0


def mark(events: LaneEvents, b: int, t: float) -> None:
    """Mark a run that is to be repeated: it may pass a level in the step from t."""
    if events.until[b] == np.inf:
        events.until[b] = t
        events.left[0] -= 1
