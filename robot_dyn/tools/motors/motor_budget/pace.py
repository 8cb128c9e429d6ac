"""The least factor λ ≥ 1 by which a motion is slowed down so that it keeps continuous torques.

A motion that takes λ times as long has u q̇ and u² q̈ with u = 1/λ, and so

    ⟨τ²⟩(u) = ⟨(N + u τ_v + u² τ_a)²⟩

a polynomial of degree 4 wherever effects are polynomials of degree 2 in the velocity; it has no reason to fall with λ,
since inertia may relieve gravity. The u that keep a limit are intervals between roots of ⟨τ²⟩(u) = τ_continuous², and
those that keep all limits their intersection. It is interpolated in each octave of u at five Chebyshev points, which
is exact for such effects; what is found is confirmed by the torque itself, as other effects need.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from robot_dyn import Plant
from robot_dyn.control import PiecewisePolynomial
from robot_dyn.tools.motors.motor_budget.demand import root_mean_squares
from robot_dyn.tools.motors.motor_budget.joint_budget import TOLERANCE

_OCTAVES = 7  # of u: λ up to 128
_DEGREE, _DENSE = 4, 201  # of the polynomial, and places of it among which the least share is sought
_NOTHING = 1e-12  # of the largest coefficient: rounding of none
_ROUNDING = 1e-8  # of a share, by which a root may pass it


class Pace(NamedTuple):
    """A factor λ on the duration, the largest share rms/limit of a joint with it, and which joint has it."""

    factor: float
    share: float
    joint: int

    @property
    def fits(self) -> bool:
        """Whether no limit is passed, but for the tolerance of budgets."""
        return self.share <= 1 + TOLERANCE


def least_pace(motion: PiecewisePolynomial, plant: Plant, continuous: np.ndarray) -> Pace:
    """The least λ from 1 to 128 that keeps continuous torques, (n,); else the λ with the least share."""

    def at(factor: float) -> Pace:
        shares = root_mean_squares(at_pace(motion, factor), plant) / continuous
        return Pace(float(factor), float(shares.max()), int(shares.argmax()))

    best = at(1.0)
    if best.share <= 1:
        return best
    for octave in range(_OCTAVES):
        u = 2.0 ** -(octave + 1) * np.array([1.0, 2.0])
        table = _squares(motion, plant, continuous, u)
        for x in (x for x in _ends(table) if chebyshev.chebval(x, table).max() <= 1 + _ROUNDING):
            if (found := at(1 / _place(u, x))).fits:
                return found
        x = np.linspace(-1, 1, _DENSE)
        least = x[chebyshev.chebval(x, table).max(axis=0).argmin()]
        best = min(best, at(1 / _place(u, least)), key=lambda each: each.share)
    return best


def at_pace(motion: PiecewisePolynomial, factor: float) -> PiecewisePolynomial:
    """The motion that takes λ times as long."""
    powers = factor ** -np.arange(motion.coefficients.shape[1], dtype=float)
    return PiecewisePolynomial(motion.breaks * factor, motion.coefficients * powers[:, None])


def _squares(motion: PiecewisePolynomial, plant: Plant, continuous: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Chebyshev coefficients of ⟨τ²⟩/τ_continuous² over an interval of u, (5, k), of joints that have a limit."""
    limited = np.isfinite(continuous)

    def of(x: np.ndarray) -> Any:
        rms = np.array([root_mean_squares(at_pace(motion, 1 / each), plant) for each in _place(u, x)])
        return (rms / continuous)[:, limited] ** 2

    return chebyshev.chebinterpolate(of, _DEGREE)


def _ends(table: np.ndarray) -> np.ndarray:
    """Places from 1 to −1 at which intervals may begin: where a joint is at its limit, and the end of the octave."""
    found = [-1.0]
    for column in table.T:
        over = column - np.eye(len(column))[0]
        roots = chebyshev.chebroots(chebyshev.chebtrim(over, _NOTHING * np.abs(over).max()))
        found += roots.real[(np.abs(roots.imag) <= _ROUNDING) & (np.abs(roots.real) <= 1)].tolist()
    return np.sort(found)[::-1]


def _place(u: np.ndarray, x: Any) -> Any:
    """The u at places x from −1 to 1 of an interval."""
    return u[0] + (u[1] - u[0]) * (1 + x) / 2
