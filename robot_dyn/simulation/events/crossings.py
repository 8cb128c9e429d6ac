"""Switching functions of a run: their values within a step, and their sides; plain functions of arrays."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.bernstein import rate_coefficients, value
from robot_dyn.integrate.primitives import between, evaluate
from robot_dyn.simulation.dynamics.loop_state import Functions, Rules, Runs
from robot_dyn.simulation.events.detection import coordinate_nears, enclosure, enclosure_of_position, function_nears

LOOKS = 11  # at a switching function that is no coordinate, in each step, see `first_event`
ROUNDING = 64 * np.finfo(float).eps  # of the coefficients of a polynomial
NEAR = 1e-4  # of a step: for the slope of a switching function that is no coordinate


class Switches(NamedTuple):
    """Switching functions: E coordinates of y, or rates of these, that pass a level, and G functions that pass one.

    The coordinates are first those of thresholds, then the guards of the mode, of which some are active.

    Attributes:
        rows: Entry of y, and then of the values of the functions, (E + G,).
        levels: Its level, (E + G,).
        sides: 1 where it is not below its level, −1 where it is not above, (E + G,).
        rates: Whether each of the first is the rate of that entry, (E,).
        active: Whether each of the first is looked at, (E,).
        thresholds, guards: Number of the thresholds of coordinates, and of guards.
        zeroed: Entries of y that are set to 0 after each step: of those only the rates matter.
        functions: Gives the F values, as of `evaluate`.
        user_defined: Number of the last functions that are looked at in each step.
        then: Room for their values, (F, 1).
        before, change: Those at the start of a step, and by how much they changed in the step before, (F,).
        exact, slack: Rounding of each coordinate near its level, and by how much it passes it before that counts, (E,).
        b, stack: Room for `bernstein`.
        looks: Room for the values of the functions within a step, times their sides, (G, LOOKS).
    """

    rows: Array
    levels: Array
    sides: Array
    rates: Array
    active: Array
    thresholds: int
    guards: int
    zeroed: Array
    functions: Any
    user_defined: int
    then: Array
    before: Array
    change: Array
    exact: Array
    slack: Array
    b: Array
    stack: Array
    looks: Array


def approaches(y: Array, after: Array, h: float, before: Array, last: Array, rules: Rules, switches: Switches) -> bool:
    """Whether a coordinate may pass its level in a step. Rates are always looked at."""
    n = 0 if rules.canonical else rules.n  # p' is no acceleration
    for e in range(len(switches.exact)):
        if not switches.active[e]:
            continue
        if switches.rates[e]:
            return True
        row = switches.rows[e]
        x0, x1, d0, d1 = y[row, 0], after[row, 0], before[row, 0], last[row, 0]
        if row < n:
            low, high = enclosure_of_position(x0, x1, d0, d1, before[n + row, 0], last[n + row, 0], h)
        else:
            low, high = enclosure(x0, x1, d0, d1, h)
        if coordinate_nears(low, high, switches.levels[e], switches.sides[e]):
            return True
    return False


def remember(t: float, y: Array, p: Array, run_parameters: Array, switches: Switches) -> None:
    """The functions at the start of a segment, or behind an event: what they did before says nothing."""
    if has_functions(switches):
        evaluate(switches.functions, t, y, p, run_parameters, switches.then)
        for i in range(len(switches.then)):
            switches.before[i], switches.change[i] = switches.then[i, 0], np.inf


def nears(t: float, y: Array, p: Array, run_parameters: Array, switches: Switches) -> bool:
    """Whether a function may pass its level in the step that ends at t: it comes near it, by its latest changes."""
    if not has_functions(switches):
        return False
    E, found = len(switches.exact), switches.user_defined > 0
    evaluate(switches.functions, t, y, p, run_parameters, switches.then)
    for e in range(E, len(switches.rows) - switches.user_defined):
        i: int = switches.rows[e]
        x0, x1, change = switches.before[i], switches.then[i, 0], switches.change[i]
        found = found or function_nears(x0, x1, change, switches.levels[e], switches.sides[e])
    for i in range(len(switches.then)):
        x = switches.then[i, 0]
        switches.before[i], switches.change[i] = x, abs(x - switches.before[i])
    return found


def has_functions(switches: Switches) -> bool:
    """Whether there are switching functions that are no coordinates."""
    return len(switches.rows) > len(switches.exact)


def gap(switches: Switches, g: int) -> float:
    """The latest value of a switching function that is no coordinate, less its level."""
    return switches.then[switches.rows[g], 0] - switches.levels[g]


def values(
    f: Functions, t: float, h: float, theta: float, y: Array, p: Array, run_parameters: Array, F: Array, x: Array,
    switches: Switches,
) -> None:  # fmt: skip
    """The switching functions that are no coordinates, within a step."""
    between(y, F, theta, x)
    evaluate(switches.functions, t + theta * h, x, p, run_parameters, switches.then)


def settle_sides(switches: Switches) -> None:
    """The side of functions that vanished at the start of the run."""
    for g in range(len(switches.exact), len(switches.rows)):
        if switches.sides[g] == 0.0:
            switches.sides[g] = np.sign(gap(switches, g))


def same_sides(t: float, y: Array, p: Array, run_parameters: Array, switches: Switches) -> bool:
    """Whether all that has a threshold is on its side of it still, behind a jump; takes the sides of other functions.

    False where something lies on its level: where it goes from there is not known here.
    """
    for e in range(switches.thresholds):
        if not switches.sides[e] * (y[switches.rows[e], 0] - switches.levels[e]) > 0.0:
            return False
    if has_functions(switches):
        evaluate(switches.functions, t, y, p, run_parameters, switches.then)
        for g in range(len(switches.exact), len(switches.rows)):
            if g >= len(switches.rows) - switches.user_defined:
                switches.sides[g] = np.sign(gap(switches, g))
            elif not switches.sides[g] * gap(switches, g) > 0.0:
                return False
    return True


def correction(
    f: Functions, t: float, h: float, whole: float, y: Array, p: Array, runs: Runs, work: Any, switches: Switches,
    event: int,
) -> float:  # fmt: skip
    """Newton's correction of the step h whose end is to be a root of a switching function."""
    if event < len(switches.exact) and switches.rates[event]:  # its slope likewise
        row, b, theta = switches.rows[event], switches.b, h / whole
        rate_coefficients(work.F, row, whole, b)
        slope = (value(b[:-1], theta + NEAR) - value(b[:-1], theta - NEAR)) / (2 * NEAR * whole)
        left = work.last[row, 0] - switches.levels[event]
    elif event < len(switches.exact):
        row = switches.rows[event]
        left, slope = runs.after[row, 0] - switches.levels[event], work.last[row, 0]
    else:  # its slope from the dense output of the whole step
        theta = h / whole
        values(f, t, whole, theta + NEAR, y, p, runs.run_parameters, work.F, runs.last, switches)
        slope = gap(switches, event)
        values(f, t, whole, theta - NEAR, y, p, runs.run_parameters, work.F, runs.last, switches)
        slope = (slope - gap(switches, event)) / (2 * NEAR * whole)
        evaluate(switches.functions, t + h, runs.after, p, runs.run_parameters, switches.then)
        left = gap(switches, event)
    return -left / slope if slope != 0.0 else 0.0
