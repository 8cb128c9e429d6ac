"""The smallest factor λ ≥ 1 on the duration of a motion that meets the continuous torque limits.

A motion that takes λ times as long has velocities u q̇ and accelerations u² q̈ with u = 1/λ, so

    ⟨τ²⟩(u) = ⟨(N + u τ_v + u² τ_a)²⟩

is a polynomial of degree 4 if effects are polynomials of degree 2 in the velocity. It need not decrease with λ, because
inertia may relieve gravity. The u that satisfy a limit form intervals between roots of ⟨τ²⟩(u) = τ_continuous²; the
u that satisfy all limits form their intersection. The function is interpolated in each octave of u at five Chebyshev
points, exactly for such effects; for others, and gear losses, a result is checked against the torque itself.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from robot_dyn import Plant
from robot_dyn.control import PiecewisePolynomial
from robot_dyn.tools.motors.gear import Gear
from robot_dyn.tools.motors.motor_budget.demand import root_mean_squares
from robot_dyn.tools.motors.motor_budget.joint_budget import TOLERANCE

_OCTAVES = 7  # octaves of u: λ up to 128
_DEGREE, _DENSE = 4, 201  # degree of the polynomial, and number of places in the search for the smallest share
_NOTHING = 1e-12  # relative to the largest coefficient: smaller ones are rounding
_ROUNDING = 1e-8  # error of a share at a root


class Pace(NamedTuple):
    """A factor λ on the duration, the largest share rms/limit of a joint with it, and the index of the joint."""

    factor: float
    fraction: float
    joint: int

    @property
    def fits(self) -> bool:
        """True if no limit is exceeded by more than the tolerance of budgets."""
        return self.fraction <= 1 + TOLERANCE


def least_pace(motion: PiecewisePolynomial, plant: Plant, continuous: np.ndarray, gear: Gear | None = None) -> Pace:
    """Return the smallest λ from 1 to 128 that meets the continuous limits, (n,); else the λ of the smallest share."""

    def at(factor: float) -> Pace:
        shares = root_mean_squares(at_pace(motion, factor), plant, gear) / continuous
        return Pace(float(factor), float(shares.max()), int(shares.argmax()))

    best = at(1.0)
    if best.fraction <= 1:
        return best
    for octave in range(_OCTAVES):
        u = 2.0 ** -(octave + 1) * np.array([1.0, 2.0])
        table = _squares(motion, plant, continuous, u, gear)
        for x in (x for x in _ends(table) if chebyshev.chebval(x, table).max() <= 1 + _ROUNDING):
            if (pace := at(1 / _place(u, x))).fits:
                return pace
        x = np.linspace(-1, 1, _DENSE)
        least = x[chebyshev.chebval(x, table).max(axis=0).argmin()]
        best = min(best, at(1 / _place(u, least)), key=lambda pace: pace.fraction)
    return best


def at_pace(motion: PiecewisePolynomial, factor: float) -> PiecewisePolynomial:
    """Return the motion that takes λ times as long."""
    powers = factor ** -np.arange(motion.coefficients.shape[1], dtype=float)
    return PiecewisePolynomial(motion.breaks * factor, motion.coefficients * powers[:, None])


def _squares(
    motion: PiecewisePolynomial, plant: Plant, continuous: np.ndarray, u: np.ndarray, gear: Gear | None
) -> np.ndarray:
    """Return Chebyshev coefficients of ⟨τ²⟩/τ_continuous² over an interval of u, (5, k), for joints with a limit."""
    limited = np.isfinite(continuous)

    def squares(x: np.ndarray) -> Any:
        rms = np.array([root_mean_squares(at_pace(motion, 1 / place), plant, gear) for place in _place(u, x)])
        return (rms / continuous)[:, limited] ** 2

    return chebyshev.chebinterpolate(squares, _DEGREE)


def _ends(table: np.ndarray) -> np.ndarray:
    """Return places from 1 to −1 at which intervals may begin: a joint at its limit, or the end of the octave."""
    places = [-1.0]
    for column in table.T:
        over = column - np.eye(len(column))[0]
        roots = chebyshev.chebroots(chebyshev.chebtrim(over, _NOTHING * np.abs(over).max()))
        places += roots.real[(np.abs(roots.imag) <= _ROUNDING) & (np.abs(roots.real) <= 1)].tolist()
    return np.sort(places)[::-1]


def _place(u: np.ndarray, x: Any) -> Any:
    """Return u at places x from −1 to 1 of an interval."""
    return u[0] + (u[1] - u[0]) * (1 + x) / 2
