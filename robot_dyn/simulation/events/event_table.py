"""The switching functions of a run: their values within a step, and their sides; plain functions of arrays."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.bernstein import rate_coefficients, value
from robot_dyn.integrate.primitives import between, evaluate
from robot_dyn.simulation.dynamics.loop_state import Function, Lanes, LoopConfig
from robot_dyn.simulation.events.detection import coordinate_nears, enclosure, enclosure_of_position, function_nears

SCANS = 11  # evaluations of each function of the table in a step that is scanned, see `first_event`
ROUNDING = 64 * np.finfo(float).eps  # relative to the coefficients of a polynomial
NEAR = 1e-4  # fraction of a step: half the width of the central difference for a slope


class EventTable(NamedTuple):
    """Switching functions: E coordinates of y, or rates of these, and G functions of (t, y), each with a level.

    The coordinates are first those of thresholds, then the guards of the contact mode, some of them active. The
    functions are first those of thresholds of the actuation, then user-defined events.

    Attributes:
        rows: Index in y for each coordinate, in `values` for each function, (E + G,).
        levels: Level of each coordinate and function, (E + G,).
        sides: 1 where the value is not below its level, −1 where it is not above, (E + G,).
        is_rate: True if the coordinate is the rate of that entry, (E,).
        active: True if the coordinate may cause an event, (E,).
        thresholds, guards: Number of thresholds of coordinates, and of guards; E is their sum.
        zeroed: Entries of y that are set to 0 after each step: only their rates matter.
        functions: Function for `evaluate` that writes `values`; None if there is none.
        user_defined: Number of user-defined events, which are scanned in each step.
        values: The latest F values of the functions, (F, 1).
        previous, change: Values at the start of a step, and how much they changed in the step before, (F,).
        rounding, slack: Rounding of each coordinate near its level, and the distance beyond it that counts, (E,).
        coefficients, stack: Work arrays for `bernstein`.
        scanned: Distances of the functions from their levels within a step, times their sides, (G, SCANS).
    """

    rows: Array
    levels: Array
    sides: Array
    is_rate: Array
    active: Array
    thresholds: int
    guards: int
    zeroed: Array
    functions: Function | None
    user_defined: int
    values: Array
    previous: Array
    change: Array
    rounding: Array
    slack: Array
    coefficients: Array
    stack: Array
    scanned: Array


class DenseWork(Protocol):
    """The arrays of a method with dense output that events read: rates K, the rate `last` at the end, and F."""

    K: Array
    last: Array
    F: Array


def coordinates(table: EventTable) -> int:
    """Return the number of coordinates, E."""
    return table.thresholds + table.guards


def has_functions(table: EventTable) -> bool:
    """Return True if there are switching functions other than coordinates."""
    return len(table.rows) > coordinates(table)


def start_table(table: EventTable, lanes: Lanes, t: float) -> None:
    """Evaluate the functions at the start of a segment, or after an event: earlier changes do not count."""
    if has_functions(table):
        evaluate(table.functions, t, lanes.y, lanes.p, lanes.run_parameters, table.values)
        for i in range(len(table.values)):
            table.previous[i], table.change[i] = table.values[i, 0], np.inf


def coordinate_approaches(table: EventTable, lanes: Lanes, config: LoopConfig, work: DenseWork, h: float) -> bool:
    """Return True if a coordinate may pass its level in a step, judged by Hermite's polynomial; rates always may."""
    n = 0 if config.canonical else config.n  # p' is not an acceleration
    y, after, first, last = lanes.y, lanes.after, work.K[0], work.last
    for e in range(coordinates(table)):
        if not table.active[e]:
            continue
        if table.is_rate[e]:
            return True
        row = table.rows[e]
        x0, x1, d0, d1 = y[row, 0], after[row, 0], first[row, 0], last[row, 0]
        if row < n:
            low, high = enclosure_of_position(x0, x1, d0, d1, first[n + row, 0], last[n + row, 0], h)
        else:
            low, high = enclosure(x0, x1, d0, d1, h)
        if coordinate_nears(low, high, table.levels[e], table.sides[e]):
            return True
    return False


def function_approaches(table: EventTable, lanes: Lanes, t: float) -> bool:
    """Return True if a function may pass its level in the step that ends at t, judged by its latest changes."""
    if not has_functions(table):
        return False
    may_pass = table.user_defined > 0
    evaluate(table.functions, t, lanes.after, lanes.p, lanes.run_parameters, table.values)
    for e in range(coordinates(table), len(table.rows) - table.user_defined):
        i: int = table.rows[e]
        x0, x1, change = table.previous[i], table.values[i, 0], table.change[i]
        may_pass = may_pass or function_nears(x0, x1, change, table.levels[e], table.sides[e])
    for i in range(len(table.values)):
        x = table.values[i, 0]
        table.previous[i], table.change[i] = x, abs(x - table.previous[i])
    return may_pass


def distance(table: EventTable, e: int) -> float:
    """Return the latest value of a function less its level; `e` is its index in the table."""
    return table.values[table.rows[e], 0] - table.levels[e]


def evaluate_within(table: EventTable, lanes: Lanes, F: Array, t: float, h: float, theta: float) -> None:
    """Evaluate the functions at t + θ h, by the dense output F of a step."""
    between(lanes.y, F, theta, lanes.inner)
    evaluate(table.functions, t + theta * h, lanes.inner, lanes.p, lanes.run_parameters, table.values)


def settle_sides(table: EventTable) -> None:
    """Write the side of functions that vanished at the start of the run."""
    for e in range(coordinates(table), len(table.rows)):
        if table.sides[e] == 0.0:
            table.sides[e] = np.sign(distance(table, e))


def same_sides(table: EventTable, lanes: Lanes, t: float) -> bool:
    """Return True if every threshold is on its side after a jump of the state; write the sides of user-defined events.

    False also if a value lies on its level: the direction in which it leaves is unknown here.
    """
    for e in range(table.thresholds):
        if not table.sides[e] * (lanes.y[table.rows[e], 0] - table.levels[e]) > 0.0:
            return False
    if has_functions(table):
        evaluate(table.functions, t, lanes.y, lanes.p, lanes.run_parameters, table.values)
        for e in range(coordinates(table), len(table.rows)):
            if e >= len(table.rows) - table.user_defined:
                table.sides[e] = np.sign(distance(table, e))
            elif not table.sides[e] * distance(table, e) > 0.0:
                return False
    return True


def newton_shift(
    table: EventTable, lanes: Lanes, work: DenseWork, event: int, t: float, h: float, whole: float
) -> float:
    """Return Newton's correction of the length of a step that should end at the root of a switching function, in [s].

    It is 0 where the slope is 0.

    Args:
        table: The switching functions.
        lanes: The run; lanes.after is the state at the end of the step.
        work: Arrays of the method, with the dense output of the whole step.
        event: Index of the switching function.
        t: Start of the step, in [s].
        h: Length of the step, in [s].
        whole: Length of the step before it was shortened, in [s].
    """
    theta, row, level = h / whole, table.rows[event], table.levels[event]
    if event >= coordinates(table):
        evaluate_within(table, lanes, work.F, t, whole, theta + NEAR)
        slope = distance(table, event)
        evaluate_within(table, lanes, work.F, t, whole, theta - NEAR)
        slope = (slope - distance(table, event)) / (2 * NEAR * whole)
        evaluate(table.functions, t + h, lanes.after, lanes.p, lanes.run_parameters, table.values)
        residual = distance(table, event)
    elif table.is_rate[event]:
        b = table.coefficients
        rate_coefficients(work.F, row, whole, b)
        slope = (value(b[:-1], theta + NEAR) - value(b[:-1], theta - NEAR)) / (2 * NEAR * whole)
        residual = work.last[row, 0] - level
    else:
        residual, slope = lanes.after[row, 0] - level, work.last[row, 0]
    return -residual / slope if slope != 0.0 else 0.0
