"""The switching function that changes sign first within a step: plain functions of arrays, for the loop of one run.

Where `detection` cannot exclude it, that a coordinate of y does not pass a level is proven by the coefficients of the
dense output in Bernstein's form. Other functions are evaluated in eighths of the step; around a least value of a
user-defined one, its minimum is searched by golden section, so that a function that passes 0 twice between two
evaluations is detected as well, if it has one minimum there. [Shampine, Thompson 2000; Kiefer 1953]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.bernstein import NONE, coefficients, first_below, rate_coefficients
from robot_dyn.simulation.dynamics.loop_state import Lanes
from robot_dyn.simulation.events.event_table import (
    NEAR,
    ROUNDING,
    SCANS,
    EventTable,
    coordinates,
    distance,
    evaluate_within,
    has_functions,
)

_HALVINGS = 50
_SECTIONS = 32  # to 2e-7 of the step: a minimum is determined to its square
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def first_event(table: EventTable, lanes: Lanes, F: Array, t: float, h: float) -> tuple[int, float]:
    """Return the switching function that changes sign first within a step, and θ; −1 if there is none.

    Args:
        table: The switching functions.
        lanes: The run at the start of the step.
        F: Dense output of the step, see `between`.
        t: Start of the step, in [s].
        h: Length of the step, in [s].
    """
    event, first = first_of_coordinates(table, lanes.y, F, h)
    if not has_functions(table):
        return event, first
    E = coordinates(table)
    for i in range(SCANS):
        evaluate_within(table, lanes, F, t, h, scan(i))
        for g in range(len(table.scanned)):
            table.scanned[g, i] = table.sides[E + g] * distance(table, E + g)
    for e in range(E, len(table.rows)):
        theta = root_of_function(table, lanes, F, t, h, e, first)
        if theta < first:
            event, first = e, theta
    return event, first


def first_of_coordinates(table: EventTable, y: Array, F: Array, h: float) -> tuple[int, float]:
    """Return the coordinate that passes its level first, and θ."""
    event, first, b = -1, NONE, table.coefficients
    for e in range(coordinates(table)):
        if not table.active[e]:
            continue
        row, side, level, count = table.rows[e], table.sides[e], table.levels[e], len(b) - table.is_rate[e]
        if table.is_rate[e]:
            rate_coefficients(F, row, h, b)
            for j in range(count):
                b[j] -= level
        else:
            coefficients(y[row, 0] - level, F, row, b)
            if y[row, 0] == level:
                b[0] = 0.0
        for j in range(count):
            b[j] *= side
        theta = first_below(b[:count], table.slack[e], table.stack)
        if theta < first:
            event, first = e, theta
    return event, first


def scan(i: int) -> float:
    """Return θ of an evaluation: eighths of the step, and a point next to each end, for a minimum next to an end."""
    if i == 0:
        return 0.0
    if i == 1:
        return NEAR
    if i == SCANS - 2:
        return 1.0 - NEAR
    if i == SCANS - 1:
        return 1.0
    return (i - 1) / (SCANS - 3)


def root_of_function(table: EventTable, lanes: Lanes, F: Array, t: float, h: float, e: int, before: float) -> float:
    """Return the first θ at which a function changes sign, by bisection; `NONE` if at `before` or later."""
    low, high = bracket(table, lanes, F, t, h, e)
    if not (high < NONE and low < before):
        return NONE
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        if side_at(table, lanes, F, t, h, e, middle) < 0.0:
            high = middle
        else:
            low = middle
    return high


def bracket(table: EventTable, lanes: Lanes, F: Array, t: float, h: float, e: int) -> tuple[float, float]:
    """Return two θ between which a function changes sign first; the second is `NONE` if it does not.

    `table.scanned` has its distances at all scans. Signs are compared at eighths of the step; scans next to the ends
    only show a minimum of a user-defined function, which `dip` searches for a negative value.
    """
    scanned, is_user_defined = table.scanned[e - coordinates(table)], e >= len(table.rows) - table.user_defined
    low = 0.0
    for i in range(1, SCANS):
        is_eighth = i != 1 and i != SCANS - 2
        if is_eighth and scanned[i] < 0.0:
            return low, scan(i)
        if is_user_defined and i < SCANS - 1 and scanned[i - 1] > scanned[i] > 0.0 and scanned[i + 1] >= scanned[i]:
            high = dip(table, lanes, F, t, h, e, i)
            if high < NONE:
                return scan(i - 1), high
        if is_eighth:
            low = scan(i)
    return low, NONE


def dip(table: EventTable, lanes: Lanes, F: Array, t: float, h: float, e: int, i: int) -> float:
    """Return a θ around scan i, lower than its neighbours, where a function is on its other side; `NONE` without one.

    By golden section. [Kiefer 1953]
    """
    g, a, d = e - coordinates(table), scan(i - 1), scan(i + 1)
    deep = -ROUNDING * max(table.scanned[g, i - 1], table.scanned[g, i + 1])
    b, c = d - _GOLDEN * (d - a), a + _GOLDEN * (d - a)
    at_b = side_at(table, lanes, F, t, h, e, b)
    at_c = side_at(table, lanes, F, t, h, e, c)
    for _ in range(_SECTIONS):
        if at_b < deep:
            return b
        if at_c < deep:
            return c
        if at_b < at_c:
            d, c, at_c = c, b, at_b
            b = d - _GOLDEN * (d - a)
            at_b = side_at(table, lanes, F, t, h, e, b)
        else:
            a, b, at_b = b, c, at_c
            c = a + _GOLDEN * (d - a)
            at_c = side_at(table, lanes, F, t, h, e, c)
    return NONE


def side_at(table: EventTable, lanes: Lanes, F: Array, t: float, h: float, e: int, theta: float) -> float:
    """Return the distance of a function from its level at t + θ h, negative on the other side."""
    evaluate_within(table, lanes, F, t, h, theta)
    return table.sides[e] * distance(table, e)
