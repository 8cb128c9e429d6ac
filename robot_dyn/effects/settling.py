"""Which joints stick and which slide: the acceleration of least constraint, and the mode that follows from it.

    a = argmin ½ (a − M⁻¹ load)ᵀ M (a − M⁻¹ load) + Σ fᵢ |aᵢ|   over joints at rest, away from stops

Where static friction exceeds sliding friction, joints break away one by one, that of the greatest energy first, and
the problem is solved again; a joint that would then move the other way is restored to rest. Plain functions of arrays,
as `convex.active_set`. [Moreau 1988; Glocker, Set-Valued Force Laws, 2001]
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.convex import active_set

_ROUNDING = 1e-12  # of the accelerations that add up


class Settling(NamedTuple):
    """Arrays of `settle` for n joints.

    Attributes:
        least, most: Bounds of the torque on a joint at rest, (n,).
        forced: Direction of joints at rest that break away, else 0, (n,); `settle` adds all that do.
        a: Output: the acceleration, (n,).
        p, f, lower, upper, place: Of the convex problem, (n,).
        rests: 1 for each joint that may stay at rest, (n,).
        friction: Friction that holds it there, (n,).
        back: 1 for each joint that broke away and was restored to rest, (n,).
        size: Size of the terms that cancel in its acceleration, (n,).
        L: For the active set, (n + 1, n); wider for n = 1, since machine code has a type for arrays of one column.
    """

    least: Array
    most: Array
    forced: Array
    a: Array
    p: Array
    f: Array
    lower: Array
    upper: Array
    place: Array
    rests: Array
    friction: Array
    back: Array
    size: Array
    L: Array


def settling(n: int) -> Settling:
    """Return arrays for n joints."""
    return Settling._make([*np.zeros((13, n)), np.zeros((n + 1, max(n, 2)))])


def settle(
    M: Array, load: Array, sliding: Array, v: Array, held: Array, direction: Array, room: Settling
) -> bool:  # fmt: skip
    """Write the acceleration, 0 for joints that stay at rest, and the mode; return False if there is no solution.

    Args:
        M: Mass matrix, (n, n).
        load: All torques but those on joints at rest, less C v and ∂V/∂q, (n,).
        sliding: Friction where sliding begins, (n,).
        v: Velocity, (n,).
        held: Output: 1 for each joint that is held, (n,).
        direction: Output: 1 or −1 for each joint that slides or is about to, (n,).
        room: Bounds of the torques at rest, and joints that break away; the acceleration is written into it.
    """
    least, most, forced, a = room.least, room.most, room.forced, room.a
    for i in range(len(v)):
        rests = v[i] == 0.0 and (least[i] < 0.0 or most[i] > 0.0)
        held_by = most[i] if most[i] < np.inf else -least[i]
        room.rests[i], room.friction[i], room.back[i] = 1.0 if rests else 0.0, held_by if rests else 0.0, 0.0
        room.lower[i] = 0.0 if rests and most[i] == np.inf else -np.inf
        room.upper[i] = 0.0 if rests and least[i] == -np.inf else np.inf
    while True:  # each joint breaks away and is restored at most once
        for i in range(len(v)):
            room.p[i] = load[i] - sliding[i] * forced[i]
            room.f[i] = room.friction[i] if forced[i] == 0.0 else 0.0
        if not least_value(M, room, a):
            return False
        if not taken_back(M, load, forced, a, room) and not broken_away(M, sliding, forced, a, room):
            break
    for i in range(len(v)):
        way = np.sign(v[i]) if v[i] != 0.0 else np.sign(a[i]) * room.rests[i]
        free = forced[i] != 0.0  # its load has just reached what held it: its acceleration may be 0 yet
        direction[i] = forced[i] if free else way
        held[i] = 0.0 if free or a[i] != 0.0 else room.rests[i]
    return True


def least_value(M: Array, room: Settling, x: Array) -> bool:
    """Write the minimum of the convex problem in `room`; return whether there is one, of finite numbers."""
    total = 0.0
    if not active_set(M, room.p, room.f, room.lower, room.upper, x, room.place, room.L):
        return False
    for i in range(len(x)):
        total += abs(x[i])
    return total < np.inf


def taken_back(M: Array, load: Array, forced: Array, a: Array, room: Settling) -> bool:
    """Restore the joints that broke away and would move the other way, by more than rounding; whether there are any."""
    against, largest, found = False, 0.0, False
    for i in range(len(a)):
        against = against or a[i] * forced[i] < 0.0
        largest = max(largest, abs(a[i]))
    if not against:
        return False
    weigh(M, load, room)
    for i in range(len(a)):
        if a[i] * forced[i] < -_ROUNDING * (largest + room.size[i]):
            forced[i], room.back[i], found = 0.0, 1.0, True
    return found


def weigh(M: Array, load: Array, room: Settling) -> None:
    """Write |M⁻¹| (|load| + friction), by the Cholesky factor of M."""
    n, L, x = len(load), room.L, room.L[len(load)]
    for i in range(n):
        room.size[i] = 0.0
        for j in range(i + 1):
            entry = M[i, j]
            for k in range(j):
                entry -= L[i, k] * L[j, k]
            L[i, j] = np.sqrt(entry) if i == j else entry / L[j, j]
    for column in range(n):
        for i in range(n):
            x[i] = 1.0 if i == column else 0.0
            for k in range(i):
                x[i] -= L[i, k] * x[k]
            x[i] /= L[i, i]
        for i in range(n - 1, -1, -1):
            for k in range(i + 1, n):
                x[i] -= L[k, i] * x[k]
            x[i] /= L[i, i]
            room.size[i] += abs(x[i]) * (abs(load[column]) + room.friction[column])


def broken_away(M: Array, slides: Array, forced: Array, a: Array, room: Settling) -> bool:
    """Let the joint of greatest energy break away, of those with less sliding friction; whether there is one."""
    which, most = -1, -1.0
    for i in range(len(a)):
        known = forced[i] != 0.0 or room.back[i] != 0.0
        if room.rests[i] != 0.0 and a[i] != 0.0 and slides[i] < room.friction[i] and not known:
            size = abs(a[i]) * np.sqrt(M[i, i])
            if size > most:
                which, most = i, size
    if which >= 0:
        forced[which] = np.sign(a[which])
    return which >= 0
