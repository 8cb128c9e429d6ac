"""Where switching functions change sign within a step: plain functions of arrays, for the loop of one run.

That a coordinate of y does not pass a level is proven by the coefficients of the dense output in Bernstein's form;
other functions are looked at eight times in each step. [Shampine, Thompson 2000]
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.integrate.bernstein import NONE, coefficients, first_below
from robot_dyn.integrate.primitives import between, evaluate
from robot_dyn.simulation.time_loop import Functions, Rules, Runs

_ROUNDING = 64 * np.finfo(float).eps  # of the coefficients of a polynomial
_LOOKS = 8  # at a switching function that is no coordinate, in each step
_HALVINGS = 50
_NEAR = 1e-4  # of a step: for the slope of a switching function that is no coordinate


class Switches(NamedTuple):
    """Switching functions: E coordinates of y that pass a level, and G functions of (t, y, p, own).

    Attributes:
        rows, levels: Entry of y, and its level, (E,).
        sides: 1 where the function is not negative, −1 where it is not positive, (E + G,).
        functions: Gives the G values, as of `evaluate`.
        then: Room for them, (G, 1).
        size: Unit of rounding of each coordinate's level, (E,).
        b, stack: Room for `bernstein`.
    """

    rows: Array
    levels: Array
    sides: Array
    functions: Any
    then: Array
    size: Array
    b: Array
    stack: Array


def approaches(y: Array, after: Array, h: float, before: Array, last: Array, rules: Rules, switches: Switches) -> bool:
    """Whether a coordinate may pass its level in a step, by Hermite's polynomial through rates at both ends.

    Its coefficients in Bernstein's form, from values and two derivatives of a position and one of a velocity, enclose
    it; as much room again is left on both sides.
    """
    n = 0 if rules.canonical else rules.n  # p' is no acceleration
    for e in range(len(switches.rows)):
        row = switches.rows[e]
        x0, x1, d0, d1 = y[row, 0], after[row, 0], before[row, 0], last[row, 0]
        low, high = min(x0, x1), max(x0, x1)
        if row < n:
            a, b = x0 + h * d0 / 5, x1 - h * d1 / 5
            c = x0 + 2 * h * d0 / 5 + h * h * before[n + row, 0] / 20
            d = x1 - 2 * h * d1 / 5 + h * h * last[n + row, 0] / 20
            low, high = min(low, a, b, c, d), max(high, a, b, c, d)
        else:
            a, b = x0 + h * d0 / 3, x1 - h * d1 / 3
            low, high = min(low, a, b), max(high, a, b)
        room = high - low
        if switches.sides[e] > 0 and not low - room > switches.levels[e]:
            return True
        if switches.sides[e] < 0 and not high + room < switches.levels[e]:
            return True
    return False


def first_event(
    f: Functions, t: float, h: float, y: Array, p: Array, runs: Runs, F: Array, switches: Switches
) -> tuple[int, float]:
    """The switching function that changes sign first within a step, and θ; −1 without any."""
    event, first, b, own = -1, NONE, switches.b, runs.own
    for e in range(len(switches.rows)):
        row, side = switches.rows[e], switches.sides[e]
        coefficients(y[row, 0] - switches.levels[e], F, row, b)
        if y[row, 0] == switches.levels[e]:
            b[0] = 0.0
        for j in range(len(b)):
            b[j] *= side
        theta = first_below(b, _ROUNDING * switches.size[e], switches.stack)
        if theta < first:
            event, first = e, theta
    E, before, x = len(switches.rows), 0.0, runs.last
    for i in range(1, _LOOKS + 1 if len(switches.then) > 0 else 0):
        theta = i / _LOOKS
        values(f, t, h, theta, y, p, own, F, x, switches)
        for g in range(len(switches.then)):
            if switches.sides[E + g] * switches.then[g, 0] < 0.0 and before < first:
                low, high = before, theta
                for _ in range(_HALVINGS):
                    middle = (low + high) / 2
                    values(f, t, h, middle, y, p, own, F, x, switches)
                    if switches.sides[E + g] * switches.then[g, 0] < 0.0:
                        high = middle
                    else:
                        low = middle
                if high < first:
                    event, first = E + g, high
                values(f, t, h, theta, y, p, own, F, x, switches)
        if event >= 0 and first <= theta:
            break
        before = theta
    return event, first


def values(
    f: Functions, t: float, h: float, theta: float, y: Array, p: Array, own: Array, F: Array, x: Array,
    switches: Switches,
) -> None:  # fmt: skip
    """The switching functions that are no coordinates, within a step."""
    between(y, F, theta, x)
    evaluate(switches.functions, t + theta * h, x, p, own, switches.then)


def settle_sides(switches: Switches) -> None:
    """The side of functions that vanished at the start of the run."""
    E = len(switches.rows)
    for g in range(len(switches.then)):
        if switches.sides[E + g] == 0.0:
            switches.sides[E + g] = np.sign(switches.then[g, 0])


def correction(
    f: Functions, t: float, h: float, whole: float, y: Array, p: Array, runs: Runs, work: Any, switches: Switches,
    event: int,
) -> float:  # fmt: skip
    """Newton's correction of the step h whose end is to be a root of a switching function."""
    E = len(switches.rows)
    if event < E:
        row = switches.rows[event]
        gap, slope = runs.after[row, 0] - switches.levels[event], work.last[row, 0]
    else:  # its slope from the dense output of the whole step
        theta = h / whole
        values(f, t, whole, theta + _NEAR, y, p, runs.own, work.F, runs.last, switches)
        slope = switches.then[event - E, 0]
        values(f, t, whole, theta - _NEAR, y, p, runs.own, work.F, runs.last, switches)
        slope = (slope - switches.then[event - E, 0]) / (2 * _NEAR * whole)
        evaluate(switches.functions, t + h, runs.after, p, runs.own, switches.then)
        gap = switches.then[event - E, 0]
    return -gap / slope if slope != 0.0 else 0.0
