"""Impacts at stops and the bounces that follow: plain functions of arrays, for the time loop.

    v⁺ = argmin ½ |v⁺ − v|²_M over v⁺ᵢ ≥ −eᵢ vᵢ at each stop that is struck or touched

Impacts at ever shorter intervals end after the sum of these intervals, Σ 2 eᵏ |v| / |a|, in one impulse that removes
the remaining velocity of their joint; the response of the other joints during that time is tracked.
[Moreau 1988; Acary, Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, 2008, ch. 8]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.effects.settling import Settling, least_value, settle
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.primitives import copy
from robot_dyn.simulation.dynamics.loop_state import Functions
from robot_dyn.simulation.events.contact_mode import (
    ContactLaws,
    ContactMode,
    apply_velocities,
    touched,
    write_bodies,
    write_reaction_bounds,
)
from robot_dyn.simulation.events.event_log import EventKind, log_event

_ACCUMULATED = 1e-6  # [s] for all remaining impacts: ending them early has an effect of second order only
_CROWDED = 20  # impacts within that time: they continue forever, for any restitution


def strike(f: Functions, t: float, y: Array, p: Array, mode: ContactMode, s: int) -> bool:
    """Apply the impact at the stops of effect s and the bounces that end after it, work included.

    Returns:
        False if the velocity after it cannot be determined.
    """
    laws, work, is_hit = mode.laws, mode.work, False
    for i in range(len(laws.rows)):
        work.side[i], work.v[i], work.rest_time[i] = touched(laws, s, y, i), y[laws.speeds[i], 0], np.inf
        is_hit = is_hit or work.side[i] * work.v[i] > 0.0
    if not is_hit:
        return True
    write_bodies(f, t, y, p, mode)
    log_impact(mode, t)
    if not impact(mode, work.v, s, work.v_impact):
        return False
    if not come_to_rest(f, t, y, p, mode, s):
        return False
    work_of_gaps = apply_velocities(laws, y, work.v_rest)
    if laws.works_of_stops[s] >= 0:
        y[laws.works_of_stops[s], 0] += kinetic_change(laws.n, work.M, work.v, work.v_rest) - work_of_gaps
    for i in range(len(laws.rows)):
        if work.side[i] * work.v[i] > 0.0:
            rests, side = work.rest_time[i] < np.inf, work.side[i]
            when = t + work.rest_time[i] if rests else t
            kind = EventKind.RESTS_AT_LAST if rests else EventKind.STRIKES
            log_event(mode.log, when, y, i, kind, side, side)
            work.struck[laws.joints[i]] = 1.0
    return True


def kinetic_change(n: int, M: Array, before: Array, after: Array) -> float:
    """Return the change of the kinetic energy of n joints, (v⁺ + v)ᵀ M (v⁺ − v) / 2."""
    total = 0.0
    for i in range(n):
        for j in range(n):
            total += (after[i] + before[i]) * M[i, j] * (after[j] - before[j])
    return total / 2


def impact(mode: ContactMode, v: Array, s: int, after: Array) -> bool:
    """Write the velocity after an impact at the stops of effect s that are touched.

    Friction forces are finite and do not contribute. Joints that come to rest get 0: a projection in the norm of M,
    which adds no energy.

    Args:
        mode: The contact mode, with M', the touched sides and the joints that rest in its work arrays.
        v: Velocity before, (N,).
        s: Index of the effect.
        after: Output: velocity after, (N,).

    Returns:
        False if the convex problem has no solution.
    """
    work, e = mode.work, mode.laws.restitution[s]
    side, rest_time = work.side, work.rest_time
    write_problem(work.settling, v, side, e, rest_time)
    if not least_value(work.M_all, work.settling, after):
        return False
    for i in range(len(v)):
        if rest_time[i] < np.inf:
            after[i] = 0.0
        elif side[i] != 0.0 and side[i] * v[i] >= 0.0 and after[i] == -(1.0 + e[i]) * v[i]:
            after[i] = -e[i] * v[i]
        else:
            after[i] = v[i] + after[i]
    return True


def write_problem(problem: Settling, v: Array, side: Array, e: Array, rest_time: Array) -> None:
    """Write the bounds of v⁺ − v of an impact, to which friction and other finite forces do not contribute.

    v⁺ = 0 for joints that come to rest. At a touched stop, |v⁺| ≥ e |v| away from it, unless the joint already leaves.
    """
    for i in range(len(v)):
        rests, approaches = rest_time[i] < np.inf, side[i] * v[i] >= 0.0
        bound = -v[i] if rests else -(1.0 + e[i]) * v[i]
        problem.p[i], problem.f[i] = 0.0, 0.0
        problem.lower[i] = bound if rests or (side[i] < 0.0 and approaches) else -np.inf
        problem.upper[i] = bound if rests or (side[i] > 0.0 and approaches) else np.inf


def come_to_rest(f: Functions, t: float, y: Array, p: Array, mode: ContactMode, s: int) -> bool:
    """Write the velocity after the bounces that follow an impact, and the time until each bouncing joint rests.

    The stop of a joint pushes that joint alone: its bounces together form one impulse that removes its velocity
    after the impact. The impulse is unknown if another joint strikes meanwhile.

    Returns:
        False if the velocity cannot be determined.
    """
    laws, work = mode.laws, mode.work
    is_crowded = mode.impact_count[0] >= _CROWDED  # for example if several stops are struck in turn
    copy(work.y, y)
    copy(work.v_rest, work.v_impact)
    while True:  # each joint once, because those at rest do not return
        apply_velocities(laws, work.y, work.v_rest)
        write_bodies(f, t, work.y, p, mode)
        write_reaction_bounds(mode, work.y)
        for i in range(len(work.v)):
            work.settling.forced[i] = 0.0
        if not settle(work.M_all, work.load, laws.sliding, work.v_rest, work.held, work.direction, work.settling):
            return False
        if not (is_crowded and rest_in_turn(mode)):
            first, left = next_at_rest(mode, s, is_crowded)
            if not left < _ACCUMULATED:
                return True
            if not is_crowded and left > time_to_stop(laws, work.y, work.settling.a, first):
                return True
            work.rest_time[first] = left
        if not impact(mode, work.v_impact, s, work.v_rest):
            return False


def next_at_rest(mode: ContactMode, s: int, is_crowded: bool) -> tuple[int, float]:
    """Return the coordinate whose bounces end first, and the time until then, in [s].

    Its bounces push the other joints, which are then loaded with it at rest.
    """
    work, first, left = mode.work, 0, np.inf
    for i in range(len(work.v)):
        e = 0.0 if is_crowded else mode.laws.restitution[s, i]
        duration = bounce_time(work.v_rest[i], work.settling.a[i], work.side[i], e)
        if duration < left:
            first, left = i, duration
    return first, left


def log_impact(mode: ContactMode, t: float) -> None:
    """Store the time of an impact and the joints that strike; drop old impacts."""
    work, count = mode.work, 0
    first = 1 if mode.impact_count[0] == len(mode.impacts) else 0
    for k in range(first, mode.impact_count[0]):
        if t - mode.impacts[k] < _ACCUMULATED:
            mode.impacts[count] = mode.impacts[k]
            for i in range(len(work.v)):
                mode.strikes[count, i] = mode.strikes[k, i]
            count += 1
    mode.impacts[count] = t
    for i in range(len(work.v)):
        mode.strikes[count, i] = 1.0 if work.side[i] * work.v[i] > 0.0 else 0.0
    mode.impact_count[0] = count + 1


def rest_in_turn(mode: ContactMode) -> bool:
    """Bring joints to rest that throw each other against their stops ever faster; return False without any."""
    work, largest, stops = mode.work, 0.0, False
    a = work.settling.a
    for i in range(len(a)):
        largest = max(largest, abs(a[i]))
    for i in range(len(a)):
        strikes = 0.0
        for k in range(mode.impact_count[0]):
            strikes += mode.strikes[k, i]
        is_slow = abs(work.v_rest[i]) < _ACCUMULATED * largest
        if strikes > 1.0 and work.side[i] != 0.0 and is_slow and work.rest_time[i] == np.inf:
            work.rest_time[i], stops = 0.0, True
    return stops


def bounce_time(v: float, a: float, side: float, e: float) -> float:
    """Return how long a joint that leaves its stop at v still bounces, Σ 2 eᵏ |v| / |a|; inf if it never rests."""
    returns = side * a > 0.0 and side * v < 0.0 and e < 1.0
    return 2.0 * abs(v) / (abs(a) * (1.0 - e)) if returns else np.inf


def time_to_stop(laws: ContactLaws, y: Array, a: Array, except_: int) -> float:
    """Return the time until another coordinate than `except_` reaches a stop, at constant acceleration."""
    earliest = np.inf
    for s in range(len(laws.lower)):
        for i in range(len(a)):
            if i != except_:
                x, v = y[laws.rows[i], 0], y[laws.speeds[i], 0]
                below, above = fall_time(x - laws.lower[s, i], v, a[i]), fall_time(laws.upper[s, i] - x, -v, -a[i])
                earliest = min(earliest, below, above)
    return earliest


def fall_time(d: float, v: float, a: float) -> float:
    """Return the time t > 0 at which d + v t + a t²/2 first vanishes, d ≥ 0; nan if it never does, or at rest."""
    root = np.sqrt(v * v - 2.0 * a * d)
    if v > 0.0:
        return (v + root) / -a if a < 0.0 else np.nan
    return 2.0 * d / (root - v)
