"""Paths q(s) without time, and the motion q(s(t)) of one whose speed is piecewise uniform in s̈.

    q̇ = q' ṡ,    q̈ = q' s̈ + q'' ṡ²

A path is a `PiecewisePolynomial` whose parameter s stands in place of the time. With s(t) quadratic between points of a
grid, q(s(t)) is a polynomial in each cell of it, of twice the degree of the path. [Siciliano et al. 2009, sec. 4.3]
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from robot_dyn.control import PiecewisePolynomial, polynomial
from robot_dyn.foundations import PlanError
from robot_dyn.foundations import numbers as checked_numbers

_MOST_POINTS = 2000
_SLOWEST = 1e-3  # of |q'|, in the path's mean: where it vanishes, s is no measure of the way
_CORNER = 1e-9  # jump of q', in |q'|
_NOISE = 1e-13  # of the largest position: what moves less within a piece rests
_FARTHEST = 1e100  # [rad] or [m]: squares do not overflow
numbers = partial(checked_numbers, error=PlanError)


def geometric_path(given: Any, joint_names: tuple[str, ...]) -> PiecewisePolynomial:
    """The path through way points, (m, n), or that of a piecewise polynomial.

    Raises:
        PlanError: If it is of another number of joints, stands still or has a corner.
    """
    n = len(joint_names)
    if not isinstance(given, PiecewisePolynomial):
        return through(numbers("points", given, ("m", n)))
    if given.n != n:
        raise PlanError(f"the path is of {given.n} joints, the arm has {n}")
    path, (first, last) = at_rest_exactly(given), given.breaks[[0, -1]]
    s = np.unique(np.concatenate([given.breaks, np.linspace(first, last, 1000)]))
    speed = np.linalg.norm(path.at(s)[1], axis=-1)
    if speed.min() <= _SLOWEST * speed.mean():
        raise PlanError(
            f"the path stands still at {s[np.argmin(speed)]:.6g}, where its velocity is 0 and no direction is known;"
            " give points on it, such as path.at(times)[0]"
        )
    inner = given.breaks[1:-1]
    ends = polynomial(path.coefficients[:-1], np.diff(given.breaks)[:-1, None]), path.at(inner)
    for k, name in enumerate(("a jump", "a corner")):
        jump = np.abs(ends[0][k] - ends[1][k]).max(axis=-1, initial=0.0)
        if jump.size and jump.max() > _CORNER * (1.0 if k == 0 else speed.max()):
            raise PlanError(f"the path has {name} at {inner[np.argmax(jump)]:.6g}: no motion follows it without a stop")
    return path


def through(points: np.ndarray) -> PiecewisePolynomial:
    """The natural cubic spline through points, (m, n), over the length of the straight lines between them.

    Raises:
        PlanError: If there are fewer than two points, or more than 2000, one is too far, or two that follow are equal.

    Source: de Boor, A Practical Guide to Splines, 2001, ch. IV.
    """
    from scipy.interpolate import CubicSpline

    if not 2 <= len(points) <= _MOST_POINTS:
        raise PlanError(f"points must be 2 to {_MOST_POINTS}, got {len(points)}")
    if (most := np.abs(points).max()) > _FARTHEST:
        raise PlanError(f"points must be within {_FARTHEST:g} rad or m, got {most:g}")
    length = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    if not (length > 1e-9 * length.sum()).all():
        raise PlanError(f"points {int(np.argmin(length))} and {int(np.argmin(length)) + 1} are equal; leave one out")
    s = np.concatenate([[0.0], np.cumsum(length)])
    spline = CubicSpline(s, points, bc_type="natural")
    return at_rest_exactly(PiecewisePolynomial(s, np.moveaxis(spline.c[::-1], 0, 1)))


def at_rest_exactly(motion: PiecewisePolynomial) -> PiecewisePolynomial:
    """The motion without what rounding moves of joints at rest: friction takes the sign of their velocity."""
    h = np.diff(motion.breaks)[:, None, None] ** np.arange(motion.coefficients.shape[1])[:, None]
    moved = np.abs(motion.coefficients[:, 1:] * h[:, 1:]).sum(axis=1)  # (k, n)
    table = motion.coefficients.copy()
    size = max(float(np.abs(table[:, 0]).max()), float(moved.max(initial=0.0)))
    table[:, 1:] = np.where((moved <= _NOISE * size)[:, None], 0.0, table[:, 1:])
    return PiecewisePolynomial(motion.breaks, table)


def turning_points(path: PiecewisePolynomial) -> np.ndarray:
    """Where a joint reverses: roots of q'ⱼ(s), sorted."""
    found: list[float] = []
    degree = path.coefficients.shape[1] - 1
    for start, end, table in zip(path.breaks, path.breaks[1:], path.coefficients, strict=False):
        slopes = table[1:] * np.arange(1.0, degree + 1)[:, None] * (end - start) ** np.arange(degree)[:, None]
        for slope in slopes.T:
            roots = np.roots(slope[::-1]) if slope.any() else np.zeros(0)
            real = roots[np.abs(roots.imag) < 1e-9].real
            found += [start + (end - start) * x for x in real if 0 < x < 1]
    return np.sort(np.array(found))


def in_time(path: PiecewisePolynomial, s: np.ndarray, x: np.ndarray) -> PiecewisePolynomial:
    """The motion along a path with ṡ² = x at the points s of a grid, each (m,), and linear in s between them.

    The breaks of the path must be points of the grid: then each cell is one polynomial in time, exactly.
    """
    speed, length = np.sqrt(x), np.diff(s)
    h = 2 * length / (speed[1:] + speed[:-1])
    u = np.diff(x) / (2 * length)
    piece = np.clip(np.searchsorted(path.breaks, s[:-1] + length / 2, side="right") - 1, 0, len(path.coefficients) - 1)
    table, offset = path.coefficients[piece], s[:-1] - path.breaks[piece]
    degree = table.shape[1] - 1
    inner = np.stack([offset, speed[:-1], u / 2], axis=1)  # s(t) − s of the path's break
    made = np.zeros((len(h), 2 * degree + 1, path.n))
    made[:, 0] = table[:, degree]
    for j in reversed(range(degree)):  # Horner's rule with polynomials
        product = made * inner[:, 0, None, None]
        product[:, 1:] += made[:, :-1] * inner[:, 1, None, None]
        product[:, 2:] += made[:, :-2] * inner[:, 2, None, None]
        made = product
        made[:, 0] += table[:, j]
    return PiecewisePolynomial(np.concatenate([[0.0], np.cumsum(h)]), made)
