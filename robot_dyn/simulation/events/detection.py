"""Whether a switching function may pass its level within a step: for one run, and for W runs in lock step.

That a coordinate of y does not is seen by Hermite's polynomial through values and rates at both ends of the step: in
Bernstein's form its coefficients enclose it. Any other function is judged by its latest changes. [Shampine, Thompson
2000] In lock step there is no dense output to look closer with: a run that may pass a level is made again by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.primitives import copy, evaluate

FASTEST = 1e6  # [rad/s] or [m/s]: a method that cuts its steps would follow an exploding state without end
_ROOM = 4.0  # times the change of a limited actuation in a step, or in the one before
_STEADY = 0.5  # of a rate: a smaller change of it within a step does not turn it


class LockStep(NamedTuple):
    """The switching functions of W runs in lock step: E coordinates of y, then functions of the actuation, K in all.

    Attributes:
        rows: Entry of y, and then of the values of the functions, (K,).
        coordinates: E.
        positions: Number of positions, which y' has the accelerations of; 0 where y has momenta.
        levels: The level of each run, (K, W); inf where it has none.
        sides: 1 above its level, −1 below; 0 before the first step, (K, W).
        rate, next_rate: y' at the start and at the end of a step, (m, W).
        values, next_values: Those of the F functions there, (F, W).
        change: By how much they changed in the step before, (F, W).
        until: Start of the first step in which a run may pass a level; inf where it passes none, (W,), in [s].
        left: Number of runs that have passed none, (1,).
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


class Detecting(NamedTuple):
    """The arrays of a step in lock step, those of the method among them, K its rates; and the switching functions."""

    method: Any
    K: Array
    switches: LockStep


def lock_step(
    rows: Array, coordinates: int, levels: Array, of_rate: int, functions: int, positions: int
) -> LockStep:  # fmt: skip
    """The switching functions of runs at their start, with `of_rate` rows of a rate; W is that of the levels (K, W)."""
    W = levels.shape[1]
    rates, values = (np.zeros((k, W)) for k in (of_rate if coordinates else 0, functions))
    return LockStep(
        rows, coordinates, positions, np.array(levels, order="C"), np.zeros(levels.shape), rates, rates.copy(), values,
        values.copy(), values.copy(), np.full(W, np.inf), np.array([W]),
    )  # fmt: skip


def enclosure(x0: float, x1: float, d0: float, d1: float, h: float) -> tuple[float, float]:
    """Bounds of the cubic through two values and rates."""
    a, b = x0 + h * d0 / 3, x1 - h * d1 / 3
    return min(x0, x1, a, b), max(x0, x1, a, b)


def enclosure_of_position(
    x0: float, x1: float, d0: float, d1: float, a0: float, a1: float, h: float
) -> tuple[float, float]:
    """Bounds of the polynomial of degree 5 through two positions, velocities and accelerations."""
    a, b = x0 + h * d0 / 5, x1 - h * d1 / 5
    c, d = x0 + 2 * h * d0 / 5 + h * h * a0 / 20, x1 - 2 * h * d1 / 5 + h * h * a1 / 20
    return min(x0, x1, a, b, c, d), max(x0, x1, a, b, c, d)


def coordinate_nears(low: float, high: float, level: float, side: float) -> bool:
    """Whether a coordinate within these bounds may pass its level; as much room again is left on both sides."""
    room = high - low
    if side > 0:
        return not low - room > level
    return not high + room < level


def function_nears(x0: float, x1: float, change: float, level: float, side: float) -> bool:
    """Whether a function may pass its level in a step from x0 to x1; `change` is that of the step before."""
    room = _ROOM * max(abs(x1 - x0), change)
    return not min(side * (x0 - level), side * (x1 - level)) > room


def leaves(x0: float, d0: float, d1: float, low: float, high: float, level: float, side: float) -> bool:
    """Whether a coordinate that starts on its side, or on the level, only moves away from it, at a steady rate.

    So do the stages of the step: they see the formula of that side alone.
    """
    on_side = side * (x0 - level) >= 0.0 and (low if side > 0 else high) == x0
    return on_side and side * d0 > 0.0 and abs(d1 - d0) <= _STEADY * abs(d0)


@cache
def detecting(step: Callable[..., int]) -> Callable[..., int]:
    """The step of a method in lock step, which also marks the runs that may pass a level in it, or move without bound.

    Once all are marked, no step is made.
    """

    def detecting_step(
        f: Any,
        c: Any,
        t: float,
        h: float,
        y: Array,
        p: Array,
        run_parameters: Array,
        after: Array,
        work: Detecting,
        lost: Array,
    ) -> int:
        of = work.switches
        if of.left[0] == 0:
            copy(after, y)
            return 0
        if t <= p[0]:  # the first step of a segment: the controller may have acted
            start(f, t, y, p, run_parameters, of)
        evaluations = step(f, c, t, h, y, p, run_parameters, after, work.method, lost)
        return evaluations + detect(f, t, h, y, p, run_parameters, after, of)

    return detecting_step


def start(f: Any, t: float, y: Array, p: Array, run_parameters: Array, of: LockStep) -> None:
    """Rates and values at the start of a segment, and the sides at that of the run."""
    E = of.coordinates
    if E > 0:
        evaluate(f.rate, t, y, p, run_parameters, of.rate)
    if len(of.values) > 0:
        evaluate(f.events, t, y, p, run_parameters, of.values)
    for e in range(len(of.rows)):
        row = of.rows[e]
        for b in range(len(of.until)):
            if of.sides[e, b] == 0.0:
                x = y[row, b] if e < E else of.values[row, b]
                of.sides[e, b] = np.sign(x - of.levels[e, b])
                if x == of.levels[e, b] and e < E:  # on the level itself, where it is going
                    of.sides[e, b] = np.sign(of.rate[row, b])


def detect(f: Any, t: float, h: float, y: Array, p: Array, run_parameters: Array, after: Array, of: LockStep) -> int:
    """Mark the runs that may pass a level in the step from y to y⁺, or move without bound; evaluations."""
    E, n = of.coordinates, of.positions
    if E > 0:
        evaluate(f.rate, t + h, after, p, run_parameters, of.next_rate)
    if len(of.values) > 0:
        evaluate(f.events, t + h, after, p, run_parameters, of.next_values)
    for e in range(len(of.rows)):
        row = of.rows[e]
        for b in range(len(of.until)):
            level, side = of.levels[e, b], of.sides[e, b]
            if e < E:
                x0, x1, d0, d1 = y[row, b], after[row, b], of.rate[row, b], of.next_rate[row, b]
                if row < n:
                    low, high = enclosure_of_position(x0, x1, d0, d1, of.rate[n + row, b], of.next_rate[n + row, b], h)
                else:
                    low, high = enclosure(x0, x1, d0, d1, h)
                if coordinate_nears(low, high, level, side) and not leaves(x0, d0, d1, low, high, level, side):
                    mark(of, b, t)
            elif function_nears(of.values[row, b], of.next_values[row, b], of.change[row, b], level, side):
                mark(of, b, t)
    for e in range(n, 2 * n):
        for b in range(len(of.until)):
            if not abs(after[e, b]) < FASTEST:
                mark(of, b, t)
    for i in range(len(of.values)):
        for b in range(len(of.until)):
            of.change[i, b] = abs(of.next_values[i, b] - of.values[i, b])
    copy(of.rate, of.next_rate)
    copy(of.values, of.next_values)
    return 1 if E > 0 else 0


def mark(of: LockStep, b: int, t: float) -> None:
    """The run is to be made again: it may pass a level in the step from t."""
    if of.until[b] == np.inf:
        of.until[b] = t
        of.left[0] -= 1
