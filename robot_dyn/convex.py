"""The convex problem behind dry friction and rigid stops, for velocities at an impact and accelerations at rest.

    min ½ (x − x₀)ᵀ M (x − x₀) + Σ fᵢ |xᵢ|   subject to   lower ≤ x ≤ upper,   given p = M x₀

    p − M x ∈ f ∂|x| + N(x)   at its one minimum, with N the normal cone of the box

Each xᵢ is free within a piece between breakpoints lower, 0 and upper, or fixed at one of them, where it is exact.
[Moreau, Unilateral contact and dry friction in finite freedom dynamics, 1988; Hintermüller, Ito, Kunisch 2002; Nocedal,
Wright, Numerical Optimization, 2nd ed., 2006, ch. 16]
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from robot_dyn.errors import RobotDynError

_NEWTON = 8  # passes that change all places at once, before one is changed at a time
_ROUNDING = 16 * np.finfo(float).eps


class Place(NamedTuple):
    """Where xᵢ is: fixed at a breakpoint, `low` = `high`, or between two.

    Attributes:
        low, high: The breakpoints.
        least, most: What (p − M x)ᵢ may be: fᵢ times the sign within a piece, an interval at a breakpoint.
    """

    low: float
    high: float
    least: float
    most: float

    @property
    def fixed(self) -> bool:
        """Whether it is at a breakpoint."""
        return self.low == self.high


def places(f: float, lower: float, upper: float) -> list[Place]:
    """All places of one coordinate, from the lower bound to the upper one."""
    inner = [0.0] if lower < 0.0 < upper else []
    points = [lower, *inner, upper]
    pieces = [Place(a, b, *[f if a >= 0.0 else -f] * 2) for a, b in pairwise(points) if a < b]
    made: list[Place] = []
    for k, point in enumerate(dict.fromkeys(points)):
        if np.isfinite(point):
            least = -np.inf if point == lower else pieces[k - 1].least
            most = np.inf if point == upper else pieces[k].least
            made.append(Place(point, point, least, most))
        made += pieces[k : k + 1]
    return made


def minimum(M: np.ndarray, p: np.ndarray, f: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """The x of least value, (n,); a coordinate at 0 or at a bound is so exactly.

    Args:
        M: Symmetric and positive definite, (n, n).
        p: M x₀, (n,).
        f: Not negative, (n,).
        lower: Lower bounds, −inf for none, (n,).
        upper: Upper bounds, not below the lower ones, inf for none, (n,).

    Raises:
        RobotDynError: If no minimum is found, as with numbers that are not finite or M that is not positive definite.
    """
    n = len(p)
    known = [places(*each) for each in zip(f.tolist(), lower.tolist(), upper.tolist(), strict=True)]
    x = np.array([min(max(0.0, a), b) for a, b in zip(lower, upper, strict=True)])
    start = [_around(of, value) for of, value in zip(known, x.tolist(), strict=True)]
    at = start
    for _ in range(_NEWTON):
        there = _on_face(M, p, known, at)
        after = _moved(M, p, f, known, at, there)
        if after == at:
            return there
        at = after
    at = list(start)
    for _ in range(100 * n + 100):
        x, hit = _descended(M, p, known, at, x)
        if not hit and not _released(M, p, f, known, at, x):
            return x
    raise RobotDynError(f"no minimum was found for M = {M.tolist()} and p = {p.tolist()}: give finite numbers")


def residual(M: np.ndarray, p: np.ndarray, f: np.ndarray, lower: np.ndarray, upper: np.ndarray, x: np.ndarray) -> float:
    """How far p − M x is from f ∂|x| + N(x), the largest over i, as a part of |pᵢ| + Σⱼ |Mᵢⱼ xⱼ| + fᵢ."""
    s, scale = p - M @ x, _scale(M, p, f, x)
    worst = 0.0
    for i, value in enumerate(x.tolist()):
        known = places(float(f[i]), float(lower[i]), float(upper[i]))
        place = known[_around(known, value)]
        gap = max(place.least - s[i], s[i] - place.most, 0.0)
        worst = max(worst, gap / scale[i] if gap else 0.0)
    return worst


def _around(of: list[Place], value: float) -> int:
    """The place of a value: the breakpoint if it is one."""
    for k, place in enumerate(of):
        if place.fixed and place.low == value:
            return k
    return next(k for k, place in enumerate(of) if not place.fixed and place.low <= value <= place.high)


def _scale(M: np.ndarray, p: np.ndarray, f: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.abs(p) + np.abs(M) @ np.abs(x) + f


def _on_face(M: np.ndarray, p: np.ndarray, known: list[list[Place]], at: list[int]) -> np.ndarray:
    """The stationary x with each coordinate at its place; those between breakpoints may come out beyond."""
    here = [of[k] for of, k in zip(known, at, strict=True)]
    free = np.array([not each.fixed for each in here])
    x = np.array([each.low if each.fixed else 0.0 for each in here])
    if free.any():
        signed = np.array([each.least for each in here])[free]
        x[free] = np.linalg.solve(M[np.ix_(free, free)], (p - M @ x)[free] - signed)
    return x


def _moved(
    M: np.ndarray, p: np.ndarray, f: np.ndarray, known: list[list[Place]], at: list[int], x: np.ndarray
) -> list[int]:
    """The places with all that are violated changed: a semismooth Newton step."""
    s, slack = p - M @ x, _ROUNDING * _scale(M, p, f, x)
    after = list(at)
    for i, (of, k) in enumerate(zip(known, at, strict=True)):
        place = of[k]
        if place.fixed:
            after[i] = k + int(s[i] > place.most + slack[i]) - int(s[i] < place.least - slack[i])
        else:
            after[i] = k + int(x[i] >= place.high) - int(x[i] <= place.low)
    return after


def _descended(
    M: np.ndarray, p: np.ndarray, known: list[list[Place]], at: list[int], x: np.ndarray
) -> tuple[np.ndarray, bool]:
    """From x towards the minimum on its face, up to the first breakpoint, where that coordinate is fixed then."""
    there, part, hit = _on_face(M, p, known, at), 1.0, -1
    for i, (of, k) in enumerate(zip(known, at, strict=True)):
        place = of[k]
        if not place.fixed and not place.low < there[i] < place.high:
            end = place.high if there[i] >= place.high else place.low
            share = (end - x[i]) / (there[i] - x[i]) if there[i] != x[i] else 0.0
            if share <= part:
                part, hit = max(share, 0.0), i
    if hit < 0:
        return there, False
    made, place = x + part * (there - x), known[hit][at[hit]]
    up = there[hit] >= place.high
    made[hit] = place.high if up else place.low
    at[hit] += 1 if up else -1
    return made, True


def _released(
    M: np.ndarray, p: np.ndarray, f: np.ndarray, known: list[list[Place]], at: list[int], x: np.ndarray
) -> bool:
    """Release the fixed coordinate whose condition is violated most, by its scale; False if none is."""
    s, scale = p - M @ x, _scale(M, p, f, x)
    worst, which = _ROUNDING, (-1, 0)
    for i, (of, k) in enumerate(zip(known, at, strict=True)):
        for gap, step in ((s[i] - of[k].most, 1), (of[k].least - s[i], -1)):
            if of[k].fixed and gap > worst * scale[i]:
                worst, which = gap / scale[i], (i, step)
    if which[0] < 0:
        return False
    at[which[0]] += which[1]
    return True
