"""Paths q(s) without time, and motions q(s(t)) along them with piecewise constant s̈.

    q̇ = q' ṡ,    q̈ = q' s̈ + q'' ṡ²

A path is a `PiecewisePolynomial` whose parameter is s instead of the time. If s(t) is quadratic between points of a
grid, q(s(t)) is a polynomial in each cell, of twice the degree of the path. [Siciliano et al. 2009, sec. 4.3]
"""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_dyn.control import PiecewisePolynomial, polynomial
from robot_dyn.foundations import JointValues, PlanError, in_order
from robot_dyn.foundations import numbers as checked_numbers

_MOST_POINTS = 2000
_SLOWEST = 1e-3  # smallest |q'|, relative to its mean along the path: where q' is 0, s does not measure length
_CORNER = 1e-9  # smallest jump of q' that is a corner, relative to |q'|
_NOISE = 1e-13  # relative to the largest position: a joint that moves less within a piece is at rest
_FARTHEST = 1e100  # [rad] or [m]: squares do not overflow
numbers = partial(checked_numbers, error=PlanError)


def geometric_path(source: PiecewisePolynomial | JointValues, joint_names: tuple[str, ...]) -> PiecewisePolynomial:
    """Return the path through way points, (m, n), or the path of a piecewise polynomial.

    Raises:
        PlanError: If it has another number of joints, stops or has a corner.
    """
    n = len(joint_names)
    if not isinstance(source, PiecewisePolynomial):
        return through(numbers("points", in_order("points", source, joint_names, error=PlanError), ("m", n)))
    if source.n != n:
        raise PlanError(f"the path has {source.n} joints, the arm has {n}; give a path of {n} joints")
    path, (first, last) = at_rest_exactly(source), source.breaks[[0, -1]]
    s = np.unique(np.concatenate([source.breaks, np.linspace(first, last, 1000)]))
    speed = np.linalg.norm(path.at(s)[1], axis=-1)
    if speed.min() <= _SLOWEST * speed.mean():
        raise PlanError(
            f"the velocity of the path is 0 at {s[np.argmin(speed)]:.6g}, so its direction is undefined;"
            " give points on the path, such as path.at(times)[0]"
        )
    inner = source.breaks[1:-1]
    ends = polynomial(path.coefficients[:-1], np.diff(source.breaks)[:-1, None]), path.at(inner)
    for k, name in enumerate(("a jump", "a corner")):
        jump = np.abs(ends[0][k] - ends[1][k]).max(axis=-1, initial=0.0)
        if jump.size and jump.max() > _CORNER * (1.0 if k == 0 else speed.max()):
            raise PlanError(f"the path has {name} at {inner[np.argmax(jump)]:.6g}: no motion follows it without a stop")
    return path


def through(points: np.ndarray) -> PiecewisePolynomial:
    """Return the natural cubic spline through points, (m, n), over the length of the straight lines between them.

    Raises:
        PlanError: If there are fewer than 2 or more than 2000 points, or one is too far, or equal to the next one.

    Source: de Boor, A Practical Guide to Splines, 2001, ch. IV.
    """
    from scipy.interpolate import CubicSpline

    if not 2 <= len(points) <= _MOST_POINTS:
        raise PlanError(f"points: from 2 to {_MOST_POINTS} are allowed, got {len(points)}")
    if (most := np.abs(points).max()) > _FARTHEST:
        raise PlanError(f"points must be within {_FARTHEST:g} rad or m, got {most:g}")
    length = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    if not (length > 1e-9 * length.sum()).all():
        raise PlanError(f"points {int(np.argmin(length))} and {int(np.argmin(length)) + 1} are equal; remove one")
    s = np.concatenate([[0.0], np.cumsum(length)])
    spline = CubicSpline(s, points, bc_type="natural")
    return at_rest_exactly(PiecewisePolynomial(s, np.moveaxis(spline.c[::-1], 0, 1)))


def at_rest_exactly(motion: PiecewisePolynomial) -> PiecewisePolynomial:
    """Return the motion with exactly 0 velocity for joints at rest: friction depends on the sign of rounding errors."""
    h = np.diff(motion.breaks)[:, None, None] ** np.arange(motion.coefficients.shape[1])[:, None]
    moved = np.abs(motion.coefficients[:, 1:] * h[:, 1:]).sum(axis=1)  # (k, n)
    table = motion.coefficients.copy()
    size = max(float(np.abs(table[:, 0]).max()), float(moved.max(initial=0.0)))
    table[:, 1:] = np.where((moved <= _NOISE * size)[:, None], 0.0, table[:, 1:])
    return PiecewisePolynomial(motion.breaks, table)


def turning_points(path: PiecewisePolynomial) -> np.ndarray:
    """Return the places at which a joint reverses: roots of q'ⱼ(s), sorted."""
    points: list[float] = []
    degree = path.coefficients.shape[1] - 1
    for start, end, table in zip(path.breaks, path.breaks[1:], path.coefficients, strict=False):
        slopes = table[1:] * np.arange(1.0, degree + 1)[:, None] * (end - start) ** np.arange(degree)[:, None]
        for slope in slopes.T:
            roots = np.roots(slope[::-1]) if slope.any() else np.zeros(0)
            real = roots[np.abs(roots.imag) < 1e-9].real
            points += [start + (end - start) * x for x in real if 0 < x < 1]
    return np.sort(np.array(points))


def in_time(path: PiecewisePolynomial, s: np.ndarray, x: np.ndarray) -> PiecewisePolynomial:
    """Return the motion along a path with ṡ² = x at the points s of a grid, both (m,), linear in s between them.

    The breaks of the path must be points of the grid: each cell is then exactly one polynomial in time.
    """
    speed, length = np.sqrt(x), np.diff(s)
    h = 2 * length / (speed[1:] + speed[:-1])
    u = np.diff(x) / (2 * length)
    piece = np.clip(np.searchsorted(path.breaks, s[:-1] + length / 2, side="right") - 1, 0, len(path.coefficients) - 1)
    table, offset = path.coefficients[piece], s[:-1] - path.breaks[piece]
    degree = table.shape[1] - 1
    inner = np.stack([offset, speed[:-1], u / 2], axis=1)  # s(t) − s of the path's break
    result = np.zeros((len(h), 2 * degree + 1, path.n))
    result[:, 0] = table[:, degree]
    for j in reversed(range(degree)):  # Horner's rule with polynomials
        product = result * inner[:, 0, None, None]
        product[:, 1:] += result[:, :-1] * inner[:, 1, None, None]
        product[:, 2:] += result[:, :-2] * inner[:, 2, None, None]
        result = product
        result[:, 0] += table[:, j]
    return PiecewisePolynomial(np.concatenate([[0.0], np.cumsum(h)]), result)
