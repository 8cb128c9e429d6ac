"""The switching function that changes sign first within a step: plain functions of arrays, for the loop of one run.

Where `detection` cannot exclude it, that a coordinate of y does not pass a level is proven by the coefficients of the
dense output in Bernstein's form. Other functions are looked at in eighths of the step; between the looks around a least
value of a user-defined one, its minimum is searched by golden section, so that a function that passes 0 twice between
two looks is seen as well, if it has one minimum there. [Shampine, Thompson 2000; Kiefer 1953]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.bernstein import NONE, coefficients, first_below, rate_coefficients
from robot_dyn.simulation.dynamics.loop_state import Functions, Runs
from robot_dyn.simulation.events.crossings import LOOKS, NEAR, ROUNDING, Switches, gap, has_functions, values

_HALVINGS = 50
_SECTIONS = 32  # to 2e-7 of the step: a minimum is known to its square
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def first_event(
    f: Functions, t: float, h: float, y: Array, p: Array, runs: Runs, F: Array, switches: Switches
) -> tuple[int, float]:
    """The switching function that changes sign first within a step, and θ; −1 without any."""
    event, first = first_of_coordinates(h, y, F, switches)
    if not has_functions(switches):
        return event, first
    look_at_functions(f, t, h, y, p, runs, F, switches)
    for g in range(len(switches.rows) - len(switches.exact)):
        theta = first_of_function(f, t, h, y, p, runs, F, switches, g, first)
        if theta < first:
            event, first = len(switches.exact) + g, theta
    return event, first


def first_of_coordinates(h: float, y: Array, F: Array, switches: Switches) -> tuple[int, float]:
    """The coordinate that passes its level first, and θ."""
    event, first, b = -1, NONE, switches.b
    for e in range(len(switches.exact)):
        if not switches.active[e]:
            continue
        row, side, d = switches.rows[e], switches.sides[e], len(b) - switches.rates[e]
        if switches.rates[e]:
            rate_coefficients(F, row, h, b)
            for j in range(d):
                b[j] -= switches.levels[e]
        else:
            coefficients(y[row, 0] - switches.levels[e], F, row, b)
            if y[row, 0] == switches.levels[e]:
                b[0] = 0.0
        for j in range(d):
            b[j] *= side
        theta = first_below(b[:d], switches.slack[e], switches.stack)
        if theta < first:
            event, first = e, theta
    return event, first


def look(i: int) -> float:
    """θ of a look: eighths of the step, and two beside its ends, by which a minimum in the first or last is seen."""
    if i == 0:
        return 0.0
    if i == 1:
        return NEAR
    if i == LOOKS - 2:
        return 1.0 - NEAR
    if i == LOOKS - 1:
        return 1.0
    return (i - 1) / (LOOKS - 3)


def look_at_functions(
    f: Functions, t: float, h: float, y: Array, p: Array, runs: Runs, F: Array, switches: Switches
) -> None:  # fmt: skip
    """Their distances from their levels, positive on the side where they are."""
    E = len(switches.exact)
    for i in range(LOOKS):
        values(f, t, h, look(i), y, p, runs.run_parameters, F, runs.last, switches)
        for g in range(len(switches.looks)):
            switches.looks[g, i] = switches.sides[E + g] * gap(switches, E + g)


def first_of_function(
    f: Functions, t: float, h: float, y: Array, p: Array, runs: Runs, F: Array, switches: Switches, g: int,
    before: float,
) -> float:  # fmt: skip
    """The θ at which a function changes sign first, if that is before another; else `NONE`."""
    x, user_defined = switches.looks[g], g >= len(switches.looks) - switches.user_defined
    low, high = 0.0, NONE
    for i in range(1, LOOKS):
        eighth = i != 1 and i != LOOKS - 2
        if eighth and x[i] < 0.0:
            high = look(i)
            break
        if user_defined and i < LOOKS - 1 and x[i - 1] > x[i] > 0.0 and x[i + 1] >= x[i]:
            high = dip(f, t, h, y, p, runs, F, switches, g, i)
            if high < NONE:
                low = look(i - 1)
                break
        if eighth:
            low = look(i)
    if not (high < NONE and low < before):
        return NONE
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        if side_at(f, t, h, middle, y, p, runs, F, switches, g) < 0.0:
            high = middle
        else:
            low = middle
    return high


def dip(
    f: Functions, t: float, h: float, y: Array, p: Array, runs: Runs, F: Array, switches: Switches, g: int, i: int
) -> float:  # fmt: skip
    """A θ around a look, lower than the looks beside it, where a function is on its other side; `NONE` if it is not."""
    a, d = look(i - 1), look(i + 1)
    deep = -ROUNDING * max(switches.looks[g, i - 1], switches.looks[g, i + 1])
    b, c = d - _GOLDEN * (d - a), a + _GOLDEN * (d - a)
    at_b = side_at(f, t, h, b, y, p, runs, F, switches, g)
    at_c = side_at(f, t, h, c, y, p, runs, F, switches, g)
    for _ in range(_SECTIONS):
        if at_b < deep:
            return b
        if at_c < deep:
            return c
        if at_b < at_c:
            d, c, at_c = c, b, at_b
            b = d - _GOLDEN * (d - a)
            at_b = side_at(f, t, h, b, y, p, runs, F, switches, g)
        else:
            a, b, at_b = b, c, at_c
            c = a + _GOLDEN * (d - a)
            at_c = side_at(f, t, h, c, y, p, runs, F, switches, g)
    return NONE


def side_at(
    f: Functions, t: float, h: float, theta: float, y: Array, p: Array, runs: Runs, F: Array, switches: Switches, g: int
) -> float:  # fmt: skip
    """The distance of a function from its level, negative on the other side."""
    values(f, t, h, theta, y, p, runs.run_parameters, F, runs.last, switches)
    return switches.sides[len(switches.exact) + g] * gap(switches, len(switches.exact) + g)
