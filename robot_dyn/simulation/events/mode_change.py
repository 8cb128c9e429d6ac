"""The end of a mode: what ends it, and the state and the mode behind it; plain functions of arrays, for the loop.

    impact        v⁺ = argmin ½ |v⁺ − v|²_M over v⁺ᵢ ≥ −eᵢ vᵢ at each stop that is struck or touched
    acceleration  that of least constraint, of the joints at rest; one that broke away moves the way it was let go

A joint that slides stops where v = 0, one that is held breaks away where the reaction λ leaves its interval.

Guards are the switching functions of a mode, in a table of so many for each coordinate, of which some are active:

    λ ≥ least   λ ≤ most   where it is held;   v   where it slides;   q ≥ lower   q ≤ upper   of each effect with stops

[Moreau 1988; Glocker 2001; Acary, Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, 2008, ch. 8]
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robot_dyn.effects.settling import settle
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.primitives import copy
from robot_dyn.simulation.dynamics.loop_state import Ended, Runs
from robot_dyn.simulation.events.crossings import ROUNDING, Switches, same_sides
from robot_dyn.simulation.events.event_log import What, note
from robot_dyn.simulation.events.holding import Holding, Laws, bodies, intervals, move_motors, snap, touched, write_mode
from robot_dyn.simulation.events.impacts import strike

REACTIONS = 2  # guards of a coordinate of which it is the reaction, the first ones; then its velocity, then its stops
_STILL = 1e-14  # [rad/s] or [m/s]: joints this slow stop together with the one that stops


def end_mode(
    f: Any, t: float, runs: Runs, p: Array, switches: Switches, of: Holding, guard: int
) -> int:  # fmt: skip
    """Go on in another mode, in y, run parameters and guards; DONE, or why the loop is to return.

    Args:
        f: The functions of the state equation.
        t: Time, in [s].
        runs: The run.
        p: Numbers of the segment.
        switches: The switching functions.
        of: The mode.
        guard: Number of the guard that has passed its level.
    """
    if not change(f, t, runs.y, p, runs.run_parameters, of, guard):
        return Ended.UNSETTLED
    write_mode(of, runs.run_parameters)
    if accumulates(of, t):
        return Ended.ACCUMULATED
    guards(of, runs.y, switches)
    if not same_sides(t, runs.y, p, runs.run_parameters, switches):
        return Ended.CHANGED
    return Ended.DONE if of.log.filled[0] <= of.log.room else Ended.PAUSED


def without_modes(
    f: Any, t: float, runs: Runs, p: Array, switches: Switches, of: Holding, guard: int
) -> int:  # fmt: skip
    """In place of `end_mode` where nothing holds joints."""
    return Ended.DONE


def at_once(laws: Laws) -> int:
    """What may happen in one event, at most."""
    return len(laws.rows) * (len(laws.lower) + 1)


def width(laws: Laws) -> int:
    """Number of guards of a coordinate."""
    return REACTIONS + 1 + 2 * len(laws.lower)


def change(f: Any, t: float, y: Array, p: Array, run_parameters: Array, of: Holding, guard: int) -> bool:
    """The state behind an event, in a mode of its own from there on; whether it was found.

    `guard` is −1 where another event than the end of the mode changes the state.
    """
    laws, room, n, N = of.laws, of.room, of.laws.n, len(of.laws.rows)
    copy(of.run_parameters[: of.held_actuation], run_parameters[: of.held_actuation])
    snap(laws, y, 0, n)
    for i in range(n):
        room.struck[i] = 0.0
        if abs(y[n + i, 0]) <= _STILL and laws.rubs[i]:
            y[n + i, 0] = 0.0
    for i in range(N):
        room.forced[i], room.was_held[i], room.was_direction[i] = 0.0, of.held[i], of.direction[i]
    way = pass_level(laws, y, guard) if guard >= 0 else 0.0
    snap(laws, y, n, N)
    for i in range(N):
        y[laws.impulses[i], 0] = 0.0
    for s in range(len(laws.lower)):
        if not strike(f, t, y, p, of, s):
            return False
    for i in range(N):
        room.forced[i] = 0.0
    i = guard // width(laws)
    if way != 0.0 and y[laws.speeds[i], 0] == 0.0:  # an impact may have thrown it back
        room.forced[i] = way
    bodies(f, t, y, p, of)
    intervals(laws, y, room.least, room.most)
    for i in range(N):
        room.v[i] = y[laws.speeds[i], 0]
    if not settle(
        room.whole, room.load, room.least, room.most, laws.sliding, room.v, room.forced, room.a, of.held, of.direction,
        room.settling,
    ):  # fmt: skip
        return False
    move_motors(of, y)
    for i in range(N):
        if room.struck[laws.joints[i]] == 0.0:
            note_change(of, t, y, i)
    return True


def pass_level(laws: Laws, y: Array, guard: int) -> float:
    """Let what ends the mode lie on its level, in y; the direction in which a joint breaks away, 0 for no reaction."""
    i, k = guard // width(laws), guard % width(laws)
    if k < REACTIONS:
        return 1.0 if k == 0 else -1.0
    if k == REACTIONS:
        y[laws.speeds[i], 0] = 0.0
    else:
        s = (k - REACTIONS - 1) // 2
        y[laws.rows[i], 0] = laws.lower[s, i] if (k - REACTIONS) % 2 == 1 else laws.upper[s, i]
    return 0.0


def note_change(of: Holding, t: float, y: Array, i: int) -> None:
    """Keep what the change of the mode is for a coordinate, if it is any."""
    laws, room, side = of.laws, of.room, 0.0
    for s in range(len(laws.lower)):
        if side == 0.0:
            side = touched(laws, s, y, i)
    was, held, before, direction = room.was_held[i], of.held[i], room.was_direction[i], of.direction[i]
    if held != 0.0 and was == 0.0:
        note(of.log, t, y, i, What.RESTS if side != 0.0 else What.STICKS, side, 0.0)
    elif was != 0.0 and held == 0.0:
        leaves = side == -direction and side != 0.0
        note(of.log, t, y, i, What.LEAVES if leaves else What.SLIDES, side, direction)
    elif before * direction < 0.0 and y[laws.speeds[i], 0] == 0.0 and laws.rubs[i]:
        note(of.log, t, y, i, What.REVERSES, side, direction)


def accumulates(of: Holding, t: float) -> bool:
    """Keep the time of a change of the mode; whether the latest ones came in next to no time."""
    most = len(of.changes)
    of.changes[of.changed[0] % most] = t
    of.changed[0] += 1
    oldest: int = of.changed[0] % most
    return of.changed[0] >= most and t - of.changes[oldest] <= of.brief


def guards(of: Holding, y: Array, switches: Switches) -> None:
    """Write the guards of the mode at a state."""
    laws, least, most, e = of.laws, of.room.least, of.room.most, switches.thresholds
    intervals(laws, y, least, most)
    for i in range(len(laws.rows)):
        x, v, held = y[laws.rows[i], 0], y[laws.speeds[i], 0], of.held[i] != 0.0
        watch(switches, e, held, least[i], 1.0)
        watch(switches, e + 1, held, most[i], -1.0)
        slides = not held and of.direction[i] != 0.0 and (laws.rubs[i] or v == 0.0)
        watch(switches, e + REACTIONS, slides, 0.0, of.direction[i])
        e += REACTIONS + 1
        for s in range(len(laws.lower)):
            free = not held and (s == 0 or i < laws.n)  # ends of gaps are in each
            for side in range(2):
                level = laws.lower[s, i] if side == 0 else laws.upper[s, i]
                leaves = x == level and v == 0.0  # then its velocity is watched until it turns
                watch(switches, e, free and not leaves, level, 1.0 if side == 0 else -1.0)
                e += 1


def watch(switches: Switches, e: int, active: bool, level: float, side: float) -> None:
    """Let a guard be active, if its level is one that can be passed."""
    switches.active[e] = active and abs(level) < np.inf
    if switches.active[e]:
        switches.levels[e], switches.sides[e] = level, side
        switches.exact[e] = switches.slack[e] = ROUNDING * max(1.0, abs(level))


def start(of: Holding, y: Array) -> None:
    """The mode at the start: all that may be held is, until the reactions are known."""
    laws, room = of.laws, of.room
    intervals(laws, y, room.least, room.most)
    for i in range(len(laws.rows)):
        v = y[laws.speeds[i], 0]
        of.held[i] = 1.0 if v == 0.0 and (room.least[i] < 0.0 or room.most[i] > 0.0) else 0.0
        of.direction[i] = np.sign(v)
    copy(room.y, y)
    move_motors(of, room.y)
