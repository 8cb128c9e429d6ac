"""Impacts at stops and the bounces that follow: plain functions of arrays, for the time loop.

    v⁺ = argmin ½ |v⁺ − v|²_M over v⁺ᵢ ≥ −eᵢ vᵢ at each stop that is struck or touched

Impacts at ever shorter intervals end after the sum of these intervals, Σ 2 eᵏ |v| / |a|, in one impulse that removes
the remaining velocity of their joint; the response of the other joints during that time is tracked.
[Moreau 1988; Acary, Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, 2008, ch. 8]
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robot_dyn.effects.settling import Settling, least_value, settle
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.primitives import copy
from robot_dyn.simulation.events.event_log import What, note
from robot_dyn.simulation.events.holding import Holding, Laws, bodies, intervals, take, touched

_ACCUMULATED = 1e-6  # [s] for all remaining impacts: ending them early has an effect of second order only
_CROWDED = 20  # impacts within that time: they continue forever, whatever the restitution


def strike(f: Any, t: float, y: Array, p: Array, of: Holding, s: int) -> bool:
    """Apply the impact at one effect's stops and the bounces that end after it, work included; return whether found."""
    laws, room, hit = of.laws, of.room, False
    for i in range(len(laws.rows)):
        room.side[i], room.v[i], room.ended[i] = touched(laws, s, y, i), y[laws.speeds[i], 0], np.inf
        hit = hit or room.side[i] * room.v[i] > 0.0
    if not hit:
        return True
    bodies(f, t, y, p, of)
    remember(of, t)
    if not impact(room.whole, room.v, room.side, laws.restitution[s], room.ended, room.first, room.settling):
        return False
    if not come_to_rest(f, t, y, p, of, s):
        return False
    of_gaps = take(laws, y, room.after)
    if laws.works_of_stops[s] >= 0:
        y[laws.works_of_stops[s], 0] += work(laws.n, room.M, room.v, room.after) - of_gaps
    for i in range(len(laws.rows)):
        if room.side[i] * room.v[i] > 0.0:
            rests, side = room.ended[i] < np.inf, room.side[i]
            when = t + room.ended[i] if rests else t
            note(of.log, when, y, i, What.RESTS_AT_LAST if rests else What.STRIKES, side, side)
            room.struck[laws.joints[i]] = 1.0
    return True


def work(n: int, M: Array, before: Array, after: Array) -> float:
    """The change of the kinetic energy of n joints, (v⁺ + v)ᵀ M (v⁺ − v) / 2."""
    total = 0.0
    for i in range(n):
        for j in range(n):
            total += (after[i] + before[i]) * M[i, j] * (after[j] - before[j])
    return total / 2


def impact(M: Array, v: Array, side: Array, e: Array, ended: Array, after: Array, room: Settling) -> bool:
    """Write the velocity after an impact at the stops on the given sides; return whether it was found.

    Friction forces are finite and do not contribute. Joints that come to rest get 0: a projection in the
    norm of M, which adds no energy.
    """
    for i in range(len(v)):
        rests, meets = ended[i] < np.inf, side[i] * v[i] >= 0.0
        bound = -v[i] if rests else -(1.0 + e[i]) * v[i]
        room.p[i], room.f[i] = 0.0, 0.0
        room.lower[i] = bound if rests or (side[i] < 0.0 and meets) else -np.inf
        room.upper[i] = bound if rests or (side[i] > 0.0 and meets) else np.inf
    if not least_value(M, room, after):
        return False
    for i in range(len(v)):
        if ended[i] < np.inf:
            after[i] = 0.0
        elif side[i] != 0.0 and side[i] * v[i] >= 0.0 and after[i] == -(1.0 + e[i]) * v[i]:
            after[i] = -e[i] * v[i]
        else:
            after[i] = v[i] + after[i]
    return True


def come_to_rest(f: Any, t: float, y: Array, p: Array, of: Holding, s: int) -> bool:
    """Write the velocity after the bounces that follow an impact, and the time until each bouncing joint rests.

    The stop of a joint pushes that joint alone: its bounces together form one impulse that removes its velocity
    after the impact. The impulse is unknown if another joint strikes meanwhile. Returns whether the velocity was found.
    """
    laws, room, crowded = of.laws, of.room, of.latest[0] >= _CROWDED  # as when several stops are struck in turn
    copy(room.y, y)
    copy(room.after, room.first)
    while True:  # each joint once, since those at rest do not return
        take(laws, room.y, room.after)
        bodies(f, t, room.y, p, of)
        intervals(laws, room.y, room.least, room.most)
        for i in range(len(room.forced)):
            room.forced[i] = 0.0
        if not settle(
            room.whole, room.load, room.least, room.most, laws.sliding, room.after, room.forced, room.a, room.held,
            room.direction, room.settling,
        ):  # fmt: skip
            return False
        if not (crowded and in_turn(of)):
            first, left = 0, np.inf  # its bounces kick the other joints, which are then loaded with it at rest
            for i in range(len(room.a)):
                e = 0.0 if crowded else laws.restitution[s, i]
                each = lasts(room.after[i], room.a[i], room.side[i], e)
                if each < left:
                    first, left = i, each
            if not left < _ACCUMULATED or (left > next_meeting(laws, room.y, room.a, first) and not crowded):
                return True
            room.ended[first] = left
        if not impact(
            room.whole, room.first, room.side, laws.restitution[s], room.ended, room.after, room.settling
        ):  # fmt: skip
            return False


def remember(of: Holding, t: float) -> None:
    """Store the time of an impact and the joints that strike; drop old impacts."""
    room, count = of.room, 0
    first = 1 if of.latest[0] == len(of.impacts) else 0
    for k in range(first, of.latest[0]):
        if t - of.impacts[k] < _ACCUMULATED:
            of.impacts[count] = of.impacts[k]
            for i in range(len(room.v)):
                of.strikes[count, i] = of.strikes[k, i]
            count += 1
    of.impacts[count] = t
    for i in range(len(room.v)):
        of.strikes[count, i] = 1.0 if room.side[i] * room.v[i] > 0.0 else 0.0
    of.latest[0] = count + 1


def in_turn(of: Holding) -> bool:
    """Bring joints to rest that throw each other against their stops ever faster; return whether any were found."""
    room, largest, found = of.room, 0.0, False
    for i in range(len(room.a)):
        largest = max(largest, abs(room.a[i]))
    for i in range(len(room.a)):
        strikes = 0.0
        for k in range(of.latest[0]):
            strikes += of.strikes[k, i]
        slow = abs(room.after[i]) < _ACCUMULATED * largest
        if strikes > 1.0 and room.side[i] != 0.0 and slow and room.ended[i] == np.inf:
            room.ended[i], found = 0.0, True
    return found


def lasts(v: float, a: float, side: float, e: float) -> float:
    """Time for which a joint leaving its stop at v still bounces, Σ 2 eᵏ |v| / |a|; inf if it does not come to rest."""
    returns = side * a > 0.0 and side * v < 0.0 and e < 1.0
    return 2.0 * abs(v) / (abs(a) * (1.0 - e)) if returns else np.inf


def next_meeting(laws: Laws, y: Array, a: Array, but: int) -> float:
    """Time until one of the other coordinates meets a stop, at constant acceleration."""
    meets = np.inf
    for s in range(len(laws.lower)):
        for i in range(len(a)):
            if i != but:
                x, v = y[laws.rows[i], 0], y[laws.speeds[i], 0]
                meets = min(meets, falls(x - laws.lower[s, i], v, a[i]), falls(laws.upper[s, i] - x, -v, -a[i]))
    return meets


def falls(d: float, v: float, a: float) -> float:
    """The time t > 0 at which d + v t + a t²/2 first vanishes, d ≥ 0; nan if it never does, or at rest."""
    root = np.sqrt(v * v - 2.0 * a * d)
    if v > 0.0:
        return (v + root) / -a if a < 0.0 else np.nan
    return 2.0 * d / (root - v)
