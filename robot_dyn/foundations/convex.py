"""The convex problem of dry friction and rigid stops, for velocities at an impact and accelerations at rest.

    min ½ (x − x₀)ᵀ M (x − x₀) + Σ fᵢ |xᵢ|   subject to   lower ≤ x ≤ upper,   given p = M x₀

    p − M x ∈ f ∂|x| + N(x)   at its unique minimum, with N the normal cone of the box

Each xᵢ has a place: fixed at a breakpoint, where it is exact, or free between two breakpoints.

    −2 lower   −1 between   0 middle   1 between   2 upper,   where middle is 0, or the bound nearest to 0

[Moreau, Unilateral contact and dry friction in finite freedom dynamics, 1988; Hintermüller, Ito, Kunisch 2002; Nocedal,
Wright, Numerical Optimization, 2nd ed., 2006, ch. 16]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.linear_algebra import cholesky_solve

PASSES = 8  # Newton passes before places are changed one at a time: 6 sufficed in 18 000 steps of an arm
LARGE = 1e300  # larger bounds count as infinite; infinity cannot be compared with symbols
ROUNDING = 16 * float(np.finfo(float).eps)


def not_found(M: np.ndarray, p: np.ndarray) -> RobotDynError:
    """Return the error for a problem whose minimum was not found."""
    return RobotDynError(f"no minimum was found for M = {M.tolist()} and p = {p.tolist()}: give finite numbers")


def residual(M: np.ndarray, p: np.ndarray, f: np.ndarray, lower: np.ndarray, upper: np.ndarray, x: np.ndarray) -> float:
    """Return the largest distance of p − M x from f ∂|x| + N(x) over i, relative to |pᵢ| + Σⱼ |Mᵢⱼ xⱼ| + fᵢ."""
    s, scale = p - M @ x, np.abs(p) + np.abs(M) @ np.abs(x) + f
    least = np.where(x == lower, -np.inf, np.where(x > 0, f, -f))
    most = np.where(x == upper, np.inf, np.where(x < 0, -f, f))
    gap = np.maximum(np.maximum(least - s, s - most), 0.0)
    return float(np.divide(gap, scale, out=np.zeros_like(gap), where=gap > 0).max(initial=0.0))


def newton(M: Array, p: Array, f: Array, lower: Array, upper: Array, place: Array) -> tuple[Array, Array]:
    """Make a semismooth Newton step: return x with each coordinate at its place, and corrected places.

    If no place changes, x is the minimum. The step runs in floats or symbols, without branches. A place at a bound that
    does not exist, for example from a previous problem, becomes the free place next to it.
    """
    place = np.minimum(np.maximum(place, np.where(lower > -LARGE, -2.0, -1.0)), np.where(upper < LARGE, 2.0, 1.0))
    free = place * place * (4 - place * place) / 3
    middle = np.minimum(np.maximum(0 * p, lower), upper)
    low, high = place < -1.5, place > 1.5
    point = (1 - free) * np.where(low, lower, np.where(high, upper, middle))
    alone = M * (free[:, None] * free[None, :]) + np.eye(len(free)) * (1 - free)
    x = cholesky_solve(alone, free * (p - M @ point - f * place) + point)
    x = np.where(free > 0.5, x, point)
    s, slack = p - M @ x, ROUNDING * (np.abs(p) + np.abs(M) @ np.abs(x) + f)
    least = np.where(high, f, np.where(low, -np.inf, np.where(middle > lower, -f, -np.inf)))
    most = np.where(low, -f, np.where(high, np.inf, np.where(middle < upper, f, np.inf)))
    released = _one(s > most + slack) - _one(s < least - slack)
    rough = np.where(middle > lower, np.where(middle < upper, f, 1.0), 1.0) > 0  # otherwise one piece, with f = 0
    below, above = np.where(rough, middle, lower), np.where(rough, middle, upper)
    reached = _one(x >= np.where(place > 0, upper, above)) - _one(x <= np.where(place > 0, below, lower))
    return x, place + np.where(free > 0.5, reached, released)


def _one(condition: Array) -> Array:
    return np.where(condition, 1.0, 0.0)


def active_set(
    M: Array, p: Array, f: Array, lower: Array, upper: Array, x: Array, place: Array, work: Array
) -> bool:  # fmt: skip
    """Write the minimum into x and its places, beginning with coordinates in the middle; return False on failure.

    The value decreases from face to face, so no face is visited twice. This is a plain function of arrays, which can be
    translated to machine code; `work` is (n + 1, n).
    """
    n, L = len(p), work
    there = work[n]
    for i in range(n):
        place[i], x[i] = 0.0, min(max(0.0, lower[i]), upper[i])
    for _ in range(100 * n + 100):
        on_face(M, p, f, lower, upper, place, L, there)
        if not descended(lower, upper, place, there, x) and not released(M, p, f, lower, upper, place, x):
            return True
    return False


def on_face(M: Array, p: Array, f: Array, lower: Array, upper: Array, place: Array, L: Array, x: Array) -> None:
    """Write the stationary x with each coordinate at its place, by the Cholesky factor of the free coordinates."""
    n = len(p)
    for i in range(n):
        if abs(place[i]) != 1.0:
            x[i] = lower[i] if place[i] < -1 else upper[i] if place[i] > 1 else min(max(0.0, lower[i]), upper[i])
    for i in range(n):
        if abs(place[i]) != 1.0:
            continue
        left = p[i] - f[i] * place[i]
        for j in range(n):
            if abs(place[j]) != 1.0:
                left -= M[i, j] * x[j]
        for j in range(i + 1):
            if abs(place[j]) == 1.0:
                entry = M[i, j]
                for k in range(j):
                    entry -= L[i, k] * L[j, k]
                L[i, j] = np.sqrt(entry) if i == j else entry / L[j, j]
                if j < i:
                    left -= L[i, j] * x[j]
            else:
                L[i, j] = 0.0
        x[i] = left / L[i, i]
    for i in range(n - 1, -1, -1):
        if abs(place[i]) == 1.0:
            for k in range(i + 1, n):
                if abs(place[k]) == 1.0:
                    x[i] -= L[k, i] * x[k]
            x[i] /= L[i, i]


def descended(lower: Array, upper: Array, place: Array, there: Array, x: Array) -> bool:
    """Move x towards a point on its face, at most to a breakpoint; return True if it fixed a coordinate there."""
    part, hit, end, way = 1.0, -1, 0.0, 0.0
    for i in range(len(x)):
        middle = min(max(0.0, lower[i]), upper[i])
        low, high = (middle, upper[i]) if place[i] > 0 else (lower[i], middle)
        if abs(place[i]) == 1.0 and not low < there[i] < high:
            up = there[i] >= high
            point = high if up else low
            fraction = (point - x[i]) / (there[i] - x[i]) if there[i] != x[i] else 0.0
            if fraction <= part:
                part, hit, end, way = max(fraction, 0.0), i, point, 1.0 if up else -1.0
    for i in range(len(x)):
        x[i] = x[i] + part * (there[i] - x[i]) if hit >= 0 else there[i]
    if hit >= 0:
        place[hit] += way
        x[hit] = end
    return hit >= 0


def released(M: Array, p: Array, f: Array, lower: Array, upper: Array, place: Array, x: Array) -> bool:
    """Free the fixed coordinate with the largest relative violation; return False without a violation."""
    worst, index, way = ROUNDING, -1, 0.0
    for i in range(len(p)):
        if abs(place[i]) == 1.0:
            continue
        s, scale = p[i], abs(p[i]) + f[i]
        for j in range(len(p)):
            s -= M[i, j] * x[j]
            scale += abs(M[i, j] * x[j])
        middle = min(max(0.0, lower[i]), upper[i])
        least, most = (-f[i] if middle > lower[i] else -np.inf), (f[i] if middle < upper[i] else np.inf)
        if place[i] < -1:
            least, most = -np.inf, -f[i]
        elif place[i] > 1:
            least, most = f[i], np.inf
        if s - most > worst * scale:
            worst, index, way = (s - most) / scale, i, 1.0
        if least - s > worst * scale:
            worst, index, way = (least - s) / scale, i, -1.0
    if index >= 0:
        place[index] += way
    return index >= 0
