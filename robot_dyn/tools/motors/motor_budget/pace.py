"""The smallest factor λ ≥ 1 on the duration of a motion that meets the continuous torque limits.

A motion that takes λ times as long has velocities u q̇ and accelerations u² q̈ with u = 1/λ, so

    ⟨τ²⟩(u) = ⟨(N + u τ_v + u² τ_a)²⟩

is a polynomial of degree 4 if effects are polynomials of degree 2 in the velocity. It need not decrease with λ, because
inertia may relieve gravity. The limit τ_continuous(u) is a constant, or a polyline of the mean speed, which is
proportional to u. The u that satisfy a limit form intervals between roots of ⟨τ²⟩(u) = τ_continuous(u)²; the u that
satisfy all limits form their intersection. The difference is interpolated between octaves of u and corners of polylines
at five Chebyshev points, exactly for such effects; for others, and gear losses, a result is checked against the torque
itself.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from robot_dyn import Plant
from robot_dyn.control import PiecewisePolynomial
from robot_dyn.tools.motors.limits import Limits, used_fraction
from robot_dyn.tools.motors.motor_budget.demand import of_motion, root_mean_squares
from robot_dyn.tools.motors.motor_budget.joint_budget import TOLERANCE

_OCTAVES = 7  # octaves of u: λ up to 128
_DEGREE, _DENSE = 4, 201  # degree of the polynomial, and number of places in the search for the smallest share
_NOTHING = 1e-12  # relative to the largest coefficient: smaller ones are rounding
_ROUNDING = 1e-8  # error of a share at a root


class Pace(NamedTuple):
    """A factor λ on the duration, the largest share rms/limit of a joint with it, the index of the joint, its limit."""

    factor: float
    fraction: float
    joint: int
    limit: float

    @property
    def fits(self) -> bool:
        """True if no limit is exceeded by more than the tolerance of budgets."""
        return self.fraction <= 1 + TOLERANCE


def least_pace(motion: PiecewisePolynomial, plant: Plant, limits: Limits) -> Pace:
    """Return the smallest λ from 1 to 128 that meets the continuous limits; else the λ of the smallest share."""
    mean_speed = of_motion(motion, plant).mean_speed

    def continuous(u: float) -> np.ndarray:
        return limits.at_mean_speed(mean_speed * u).continuous

    def squares(u: float) -> np.ndarray:
        return root_mean_squares(at_pace(motion, 1 / u), plant, limits.gear) ** 2

    def at(u: float) -> Pace:
        shares = used_fraction(np.sqrt(squares(u)), continuous(u))
        i = int(shares.argmax())
        return Pace(float(1 / u), float(shares[i]), i, float(continuous(u)[i]))

    best, limited = at(1.0), np.isfinite(continuous(0.0))
    if best.fraction <= 1:
        return best
    scale = continuous(0.0)[limited] ** 2
    ends = 2.0 ** -np.arange(_OCTAVES + 1)
    for high, low in pairwise(np.union1d(ends, _corners(limits, mean_speed, ends))[::-1]):
        u = np.array([low, high])

        def over(x: np.ndarray, u: np.ndarray = u) -> Any:
            return np.array([(squares(y) - continuous(y) ** 2)[limited] / scale for y in _place(u, x)])

        table = chebyshev.chebinterpolate(over, _DEGREE)
        for x in (x for x in _ends(table) if chebyshev.chebval(x, table).max() <= _ROUNDING):
            if (pace := at(_place(u, x))).fits:
                return pace
        x = np.linspace(-1, 1, _DENSE)
        limit = np.array([continuous(y)[limited] for y in _place(u, x)]).T ** 2
        shares = used_fraction(chebyshev.chebval(x, table) * scale[:, None] + limit, limit)
        best = min(best, at(_place(u, x[shares.max(axis=0).argmin()])), key=lambda pace: pace.fraction)
    return best


def _corners(limits: Limits, mean_speed: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the u between the ends at which the mean speed of a joint is at a corner of its continuous torque."""
    if limits.continuous_line is None:
        return ends
    speed = limits.continuous_line.speed
    corners = np.divide(speed, mean_speed[:, None], out=np.zeros_like(speed), where=mean_speed[:, None] > 0)
    return corners[(corners > ends[-1]) & (corners < ends[0])]


def at_pace(motion: PiecewisePolynomial, factor: float) -> PiecewisePolynomial:
    """Return the motion that takes λ times as long."""
    powers = factor ** -np.arange(motion.coefficients.shape[1], dtype=float)
    return PiecewisePolynomial(motion.breaks * factor, motion.coefficients * powers[:, None])


def _ends(table: np.ndarray) -> np.ndarray:
    """Return places from 1 to −1 at which intervals may begin: a joint at its limit, or the end of the interval."""
    places = [-1.0]
    for over in table.T:
        roots = chebyshev.chebroots(chebyshev.chebtrim(over, _NOTHING * np.abs(over).max()))
        places += roots.real[(np.abs(roots.imag) <= _ROUNDING) & (np.abs(roots.real) <= 1)].tolist()
    return np.sort(places)[::-1]


def _place(u: np.ndarray, x: Any) -> Any:
    """Return u at places x from −1 to 1 of an interval."""
    return u[0] + (u[1] - u[0]) * (1 + x) / 2
