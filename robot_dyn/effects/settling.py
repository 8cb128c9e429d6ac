"""Sticking and sliding joints: the acceleration of least constraint, and the mode that follows from it.

    a = argmin ½ (a − M⁻¹ load)ᵀ M (a − M⁻¹ load) + Σ fᵢ |aᵢ|   over joints at rest, away from stops

If static friction exceeds sliding friction, joints break away one by one, that with the largest |a| √M_ii first, and
the problem is solved again. A joint that would then move the other way is restored to rest. Like `convex.active_set`,
these are plain functions of arrays, so that they can be compiled.
[Moreau 1988; Glocker, Set-Valued Force Laws, 2001]
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.convex import active_set

_ROUNDING = 1e-12  # relative to the accelerations that add up


class Settling(NamedTuple):
    """Arrays of `settle` for n joints.

    Attributes:
        least, most: Bounds of the torque on a joint at rest, (n,).
        forced: Direction of joints at rest that break away, else 0, (n,); `settle` adds those that it finds.
        a: Output: the acceleration, (n,).
        p, f, lower, upper, place: Arrays of the convex problem, (n,).
        rests: 1 for joints that may stay at rest, else 0, (n,).
        friction: Friction that holds these joints, (n,).
        back: 1 for joints that broke away and were restored to rest, else 0, (n,).
        size: Size of the terms that cancel in the acceleration, (n,).
        L: Matrix for the active set, (n + 1, max(n, 2)): in machine code, arrays of one column have another type.
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
    M: Array, load: Array, slides: Array, v: Array, held: Array, direction: Array, work: Settling
) -> bool:  # fmt: skip
    """Write the acceleration, 0 for joints that stay at rest, and the mode; return False if there is no solution.

    Args:
        M: Mass matrix, (n, n).
        load: All torques, without those that hold joints at rest, minus C v and ∂V/∂q, (n,).
        slides: Friction at the start of sliding, (n,).
        v: Velocity, (n,).
        held: Output: 1 for each joint that is held, (n,).
        direction: Output: 1 or −1 for each joint that slides or is about to, (n,).
        work: Bounds of the torques at rest, and joints that break away; the acceleration is written into it.
    """
    least, most, forced, a = work.least, work.most, work.forced, work.a
    for i in range(len(v)):
        rests = v[i] == 0.0 and (least[i] < 0.0 or most[i] > 0.0)
        friction = most[i] if most[i] < np.inf else -least[i]
        work.rests[i], work.friction[i], work.back[i] = 1.0 if rests else 0.0, friction if rests else 0.0, 0.0
        work.lower[i] = 0.0 if rests and most[i] == np.inf else -np.inf
        work.upper[i] = 0.0 if rests and least[i] == -np.inf else np.inf
    while True:  # each joint breaks away and is restored at most once
        for i in range(len(v)):
            work.p[i] = load[i] - slides[i] * forced[i]
            work.f[i] = work.friction[i] if forced[i] == 0.0 else 0.0
        if not least_value(M, work, a):
            return False
        if not restored_joints(M, load, forced, a, work) and not broken_away(M, slides, forced, a, work):
            break
    for i in range(len(v)):
        way = np.sign(v[i]) if v[i] != 0.0 else np.sign(a[i]) * work.rests[i]
        free = forced[i] != 0.0  # the load has just reached breakaway: the acceleration may still be 0
        direction[i] = forced[i] if free else way
        held[i] = 0.0 if free or a[i] != 0.0 else work.rests[i]
    return True


def least_value(M: Array, work: Settling, x: Array) -> bool:
    """Write the minimum of the convex problem in `work`; return False if there is no finite one."""
    total = 0.0
    if not active_set(M, work.p, work.f, work.lower, work.upper, x, work.place, work.L):
        return False
    for i in range(len(x)):
        total += abs(x[i])
    return total < np.inf


def restored_joints(M: Array, load: Array, forced: Array, a: Array, work: Settling) -> bool:
    """Restore joints that broke away but would move the other way, by more than rounding; return True if any."""
    against, largest, restored = False, 0.0, False
    for i in range(len(a)):
        against = against or a[i] * forced[i] < 0.0
        largest = max(largest, abs(a[i]))
    if not against:
        return False
    weigh(M, load, work)
    for i in range(len(a)):
        if a[i] * forced[i] < -_ROUNDING * (largest + work.size[i]):
            forced[i], work.back[i], restored = 0.0, 1.0, True
    return restored


def weigh(M: Array, load: Array, work: Settling) -> None:
    """Write |M⁻¹| (|load| + friction) to `work.size`, by the Cholesky factor of M."""
    n, L, x = len(load), work.L, work.L[len(load)]
    for i in range(n):
        work.size[i] = 0.0
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
            work.size[i] += abs(x[i]) * (abs(load[column]) + work.friction[column])


def broken_away(M: Array, slides: Array, forced: Array, a: Array, work: Settling) -> bool:
    """Let one joint with sliding below static friction break away, largest |a| √M_ii; return False if there is none."""
    largest, most = -1, -1.0
    for i in range(len(a)):
        was_decided = forced[i] != 0.0 or work.back[i] != 0.0
        if work.rests[i] != 0.0 and a[i] != 0.0 and slides[i] < work.friction[i] and not was_decided:
            size = abs(a[i]) * np.sqrt(M[i, i])
            if size > most:
                largest, most = i, size
    if largest >= 0:
        forced[largest] = np.sign(a[largest])
    return largest >= 0
