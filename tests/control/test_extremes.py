"""Extremes of piecewise polynomials, against the roots of their derivatives by NumPy, of all pieces."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import polynomial

from robot_dyn.control import PiecewisePolynomial, extreme_values


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("pieces", [1, 7, 100])
def test_extremes_are_those_at_the_roots_of_the_derivative(pieces: int, order: int) -> None:
    """Eigenvalues of NumPy's companion matrices find a root to 1e-8 and, being extremes, values to its square."""
    rng = np.random.default_rng(pieces + order)
    breaks = np.cumsum(np.concatenate([[0.3], rng.uniform(0.1, 0.9, pieces)]))
    motion = PiecewisePolynomial(breaks, rng.normal(size=(pieces, 6, 3)))
    found = extreme_values(motion, order)
    for joint in range(3):
        values, times = [], []
        for start, h, table in zip(breaks, np.diff(breaks), motion.coefficients[..., joint], strict=False):
            p = polynomial.polyder(table, order)
            roots = polynomial.polyroots(polynomial.polyder(p))
            real = roots[np.abs(roots.imag) < 1e-9].real
            at = np.array([0.0, h, *real[(real > 0) & (real < h)]])
            values, times = [*values, *polynomial.polyval(at, p)], [*times, *(start + at)]
        low, high = int(np.argmin(values)), int(np.argmax(values))
        given = found.least[joint], found.greatest[joint], found.at_least[joint], found.at_greatest[joint]
        np.testing.assert_allclose(given, [values[low], values[high], times[low], times[high]], rtol=1e-7, atol=1e-9)


def test_joints_that_rest_have_their_position_as_both() -> None:
    found = extreme_values(PiecewisePolynomial([0.0, 1.0, 2.0], np.full((2, 1, 2), [[0.3, -0.4]])))
    np.testing.assert_array_equal(found.least, [0.3, -0.4])
    np.testing.assert_array_equal(found.greatest, [0.3, -0.4])
