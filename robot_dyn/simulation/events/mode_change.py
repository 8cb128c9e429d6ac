"""The end of a contact mode: the state and the mode after it; plain functions of arrays, for the loop.

    impact        v⁺ = argmin ½ |v⁺ − v|²_M over v⁺ᵢ ≥ −eᵢ vᵢ at each stop that is struck or touched
    acceleration  of least constraint, for the joints at rest; one that broke away moves in the direction of the force

A joint that slides stops where v = 0; one that is held breaks away where the reaction λ leaves its interval.

Guards are the switching functions of a mode, the same number for each coordinate; some of them are active:

    λ ≥ least   λ ≤ most   where it is held;   v   where it slides;   q ≥ lower   q ≤ upper   of each effect with stops

[Moreau 1988; Glocker 2001; Acary, Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, 2008, ch. 8]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.effects.settling import settle
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.primitives import copy
from robot_dyn.simulation.dynamics.loop_state import Ended, Functions, Lanes
from robot_dyn.simulation.events.contact_mode import (
    ContactLaws,
    ContactMode,
    move_motors,
    snap,
    touched,
    write_bodies,
    write_mode,
    write_reaction_bounds,
)
from robot_dyn.simulation.events.event_log import EventKind, log_event
from robot_dyn.simulation.events.event_table import ROUNDING, EventTable, same_sides
from robot_dyn.simulation.events.impacts import strike

REACTIONS = 2  # guards of the reaction of a coordinate, the first ones; then of its velocity, then of its stops
_STILL = 1e-14  # [rad/s] or [m/s]: joints this slow stop together with the one that stops


def end_mode(f: Functions, t: float, lanes: Lanes, table: EventTable, mode: ContactMode, guard: int) -> int:
    """Change the mode at the event of a guard, in y, run parameters and guards.

    Args:
        f: Functions of the state equation.
        t: Time, in [s].
        lanes: The run.
        table: The switching functions.
        mode: The contact mode.
        guard: Number of the guard that has passed its level.

    Returns:
        `Ended.DONE`, or the reason for which the loop returns.
    """
    if not change_mode(f, t, lanes, mode, guard):
        return Ended.UNSETTLED
    write_mode(mode, lanes.run_parameters)
    if accumulates(mode, t):
        return Ended.ACCUMULATED
    write_guards(mode, lanes.y, table)
    if not same_sides(table, lanes, t):
        return Ended.CHANGED
    return Ended.DONE if mode.log.filled[0] <= mode.log.limit else Ended.PAUSED


def without_modes(f: Functions, t: float, lanes: Lanes, table: EventTable, mode: ContactMode, guard: int) -> int:
    """Return `Ended.DONE`: the `end_mode` of an equation in which nothing holds joints."""
    return Ended.DONE


def rows_of_event(laws: ContactLaws) -> int:
    """Return the largest number of log rows of one event."""
    return len(laws.rows) * (len(laws.lower) + 1)


def guard_count(laws: ContactLaws) -> int:
    """Return the number of guards of a coordinate."""
    return REACTIONS + 1 + 2 * len(laws.lower)


def change_mode(f: Functions, t: float, lanes: Lanes, mode: ContactMode, guard: int) -> bool:
    """Compute the state after an event, and the mode that follows.

    Args:
        f: Functions of the state equation.
        t: Time, in [s].
        lanes: The run.
        mode: The contact mode.
        guard: Number of the guard that has passed its level; −1 for a jump of the state by another cause.

    Returns:
        False if a convex problem has no solution.
    """
    laws, work, settling, y, i = mode.laws, mode.work, mode.work.settling, lanes.y, guard // guard_count(mode.laws)
    copy(mode.run_parameters[: mode.held_actuation], lanes.run_parameters[: mode.held_actuation])
    forced = begin_event(mode, y, guard)
    for s in range(len(laws.lower)):
        if not strike(f, t, y, lanes.p, mode, s):
            return False
    for k in range(len(laws.rows)):
        settling.forced[k] = 0.0
    if forced != 0.0 and y[laws.speeds[i], 0] == 0.0:  # an impact may have thrown it back
        settling.forced[i] = forced
    write_bodies(f, t, y, lanes.p, mode)
    write_reaction_bounds(mode, y)
    for k in range(len(laws.rows)):
        work.v[k] = y[laws.speeds[k], 0]
    if not settle(work.M_all, work.load, laws.sliding, work.v, mode.held, mode.direction, settling):
        return False
    move_motors(mode, y)
    for k in range(len(laws.rows)):
        if work.struck[laws.joints[k]] == 0.0:
            log_change(mode, t, y, k)
    return True


def begin_event(mode: ContactMode, y: Array, guard: int) -> float:
    """Store the mode before the event, and move coordinates exactly to their stops, levels and to rest, in y.

    Returns:
        The direction in which the joint of the guard breaks away; 0 if it does not.
    """
    laws, work, n, N = mode.laws, mode.work, mode.laws.n, len(mode.laws.rows)
    snap(laws, y, 0, n)
    for i in range(n):
        work.struck[i] = 0.0
        if abs(y[n + i, 0]) <= _STILL and laws.has_friction[i]:
            y[n + i, 0] = 0.0
    for i in range(N):
        work.settling.forced[i] = 0.0
        work.previous_held[i], work.previous_direction[i] = mode.held[i], mode.direction[i]
    direction = move_to_level(laws, y, guard) if guard >= 0 else 0.0
    snap(laws, y, n, N)
    for i in range(N):
        y[laws.impulses[i], 0] = 0.0
    return direction


def move_to_level(laws: ContactLaws, y: Array, guard: int) -> float:
    """Move the coordinate of a guard exactly to its level, in y; return the direction of a breakaway, else 0."""
    i, k = guard // guard_count(laws), guard % guard_count(laws)
    if k < REACTIONS:
        return 1.0 if k == 0 else -1.0
    if k == REACTIONS:
        y[laws.speeds[i], 0] = 0.0
    else:
        s = (k - REACTIONS - 1) // 2
        y[laws.rows[i], 0] = laws.lower[s, i] if (k - REACTIONS) % 2 == 1 else laws.upper[s, i]
    return 0.0


def log_change(mode: ContactMode, t: float, y: Array, i: int) -> None:
    """Log the change of the mode of a coordinate, if there is one."""
    laws, log, side = mode.laws, mode.log, 0.0
    for s in range(len(laws.lower)):
        if side == 0.0:
            side = touched(laws, s, y, i)
    was_held, held = mode.work.previous_held[i] != 0.0, mode.held[i] != 0.0
    before, direction = mode.work.previous_direction[i], mode.direction[i]
    if held and not was_held:
        log_event(log, t, y, i, EventKind.RESTS if side != 0.0 else EventKind.STICKS, side, 0.0)
    elif was_held and not held:
        leaves = side == -direction and side != 0.0
        log_event(log, t, y, i, EventKind.LEAVES if leaves else EventKind.SLIDES, side, direction)
    elif before * direction < 0.0 and y[laws.speeds[i], 0] == 0.0 and laws.has_friction[i]:
        log_event(log, t, y, i, EventKind.REVERSES, side, direction)


def accumulates(mode: ContactMode, t: float) -> bool:
    """Store the time of a change of the mode; return True if the latest changes lie within a very short time."""
    most = len(mode.changes)
    mode.changes[mode.change_count[0] % most] = t
    mode.change_count[0] += 1
    count: int = mode.change_count[0]
    return count >= most and t - mode.changes[count % most] <= mode.brief


def write_guards(mode: ContactMode, y: Array, table: EventTable) -> None:
    """Write the guards of the mode at a state into the table."""
    laws, bounds, e = mode.laws, mode.work.settling, table.thresholds
    write_reaction_bounds(mode, y)
    for i in range(len(laws.rows)):
        x, v, held = y[laws.rows[i], 0], y[laws.speeds[i], 0], mode.held[i] != 0.0
        write_guard(table, e, held, bounds.least[i], 1.0)
        write_guard(table, e + 1, held, bounds.most[i], -1.0)
        # without friction, a joint has this guard only while it leaves a stop: until it turns
        slides = not held and mode.direction[i] != 0.0 and (laws.has_friction[i] or v == 0.0)
        write_guard(table, e + REACTIONS, slides, 0.0, mode.direction[i])
        e += REACTIONS + 1
        for s in range(len(laws.lower)):
            is_free = not held and (s == 0 or i < laws.n)  # each effect has the ends of gaps
            for side in range(2):
                level = laws.lower[s, i] if side == 0 else laws.upper[s, i]
                leaves = x == level and v == 0.0  # then the guard of its velocity is active instead
                write_guard(table, e, is_free and not leaves, level, 1.0 if side == 0 else -1.0)
                e += 1


def write_guard(table: EventTable, e: int, active: bool, level: float, side: float) -> None:
    """Write if a guard is active; a guard without a finite level is not."""
    table.active[e] = active and abs(level) < np.inf
    if table.active[e]:
        table.levels[e], table.sides[e] = level, side
        table.rounding[e] = table.slack[e] = ROUNDING * max(1.0, abs(level))


def start_mode(mode: ContactMode, y: Array) -> None:
    """Write the mode at the start: all coordinates that may be held are, until the reactions are computed."""
    laws, work = mode.laws, mode.work
    write_reaction_bounds(mode, y)
    for i in range(len(laws.rows)):
        v, can_hold = y[laws.speeds[i], 0], work.settling.least[i] < 0.0 or work.settling.most[i] > 0.0
        mode.held[i] = 1.0 if v == 0.0 and can_hold else 0.0
        mode.direction[i] = np.sign(v)
    copy(work.y, y)
    move_motors(mode, work.y)
