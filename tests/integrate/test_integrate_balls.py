"""A step in balls holds the exact result of the step."""

from __future__ import annotations

from fractions import Fraction
from math import factorial

import numpy as np
import pytest
from flint import arb, fmpq

from robot_dyn.foundations import Ball, midpoint, radius
from robot_dyn.integrate import ExplicitRungeKutta, GaussLegendre, Integrator, MoreauJean, Surd
from robot_dyn.integrate.tableau import Coefficient
from tests.integrate.test_integrate import ANY_ARITHMETIC, OSCILLATOR, PENDULUM, name_of


def exact(coefficient: Coefficient) -> Fraction:
    """The value of a coefficient of an explicit tableau: none is a surd."""
    assert not isinstance(coefficient, Surd)
    return Fraction(coefficient)


def stability_matrix(integrator: Integrator, z: list[list[Fraction]]) -> list[list[Fraction]]:
    """R(z) for a 2 × 2 matrix z = h J, in rational arithmetic: 1 + Σ bᵀ Aᵏ⁻¹ 1 zᵏ if explicit, Padé of Gauss."""
    one = [[Fraction(1), Fraction(0)], [Fraction(0), Fraction(1)]]

    def times(A: list[list[Fraction]], B: list[list[Fraction]]) -> list[list[Fraction]]:
        return [[sum((A[i][k] * B[k][j] for k in range(2)), Fraction(0)) for j in range(2)] for i in range(2)]

    def polynomial(coefficients: list[Fraction]) -> list[list[Fraction]]:
        total, power = [[Fraction(0)] * 2, [Fraction(0)] * 2], one
        for coefficient in coefficients:
            total = [[total[i][j] + coefficient * power[i][j] for j in range(2)] for i in range(2)]
            power = times(power, z)
        return total

    if isinstance(integrator, GaussLegendre):  # HW II, theorem IV.3.11: the diagonal Padé approximation of eᶻ
        s = integrator.order // 2
        p = [
            Fraction(factorial(2 * s - k) * factorial(s), factorial(2 * s) * factorial(k) * factorial(s - k))
            for k in range(s + 1)
        ]
        (a, b), (c, d) = polynomial([(-1) ** k * each for k, each in enumerate(p)])
        inverse = [[d / (a * d - b * c), -b / (a * d - b * c)], [-c / (a * d - b * c), a / (a * d - b * c)]]
        return times(inverse, polynomial(p))
    if isinstance(integrator, MoreauJean):  # Störmer and Verlet: q_m = q + h/2 v, v⁺ = v − h q_m, q⁺ = q_m + h/2 v⁺
        h = z[0][1]
        return [[1 - h * h / 2, h - h**3 / 4], [-h, 1 - h * h / 2]]
    if not isinstance(integrator, ExplicitRungeKutta):  # semi-implicit Euler: v⁺ = v − h q, q⁺ = q + h v⁺
        h = z[0][1]
        return [[1 - h * h, h], [-h, Fraction(1)]]
    tableau = integrator.tableau
    stages = range(len(tableau.b))
    a = [[exact(row[j]) if j < len(row) else Fraction(0) for j in stages] for row in tableau.a]
    weights, coefficients = [Fraction(1) for _ in stages], [Fraction(1)]
    for _ in stages:
        coefficients.append(sum((exact(tableau.b[i]) * weights[i] for i in stages), Fraction(0)))
        weights = [sum((a[i][j] * weights[j] for j in stages), Fraction(0)) for i in stages]
    return polynomial(coefficients)


@pytest.mark.parametrize("bits", [53, 200])
@pytest.mark.parametrize("integrator", ANY_ARITHMETIC, ids=name_of)
def test_a_step_in_balls_encloses_the_exact_one(integrator: Integrator, bits: int) -> None:
    """Of the oscillator, in rational arithmetic; tightly, for coefficients up to 43: in 256 units of the last bit."""
    h, ball = Fraction(3, 8), Ball(bits)
    R = stability_matrix(integrator, [[Fraction(0), h], [-h, Fraction(0)]])
    start = [Fraction(3, 4), Fraction(-5, 8)]
    with ball.scope():
        got = integrator.step(OSCILLATOR, 0.0, ball.array([float(each) for each in start]), float(h))
        assert radius(got).max() < 256 * 2.0**-bits
    with Ball(4000).scope():
        for i in range(2):
            expected = R[i][0] * start[0] + R[i][1] * start[1]
            assert got[i].contains(arb(fmpq(expected.numerator, expected.denominator)))


@pytest.mark.parametrize("integrator", ANY_ARITHMETIC, ids=name_of)
def test_a_step_from_wide_balls_holds_the_steps_from_inside(integrator: Integrator) -> None:
    """Nonlinear: from a box of ±0.01, all steps from its corners and middle; the box grows less than fivefold."""
    centre, ball = np.array([0.4, -0.3, 0.2]), Ball(53)
    with ball.scope():
        box = integrator.step(PENDULUM, 0.3, np.array([arb(x, 0.01) for x in centre]), 0.125)
    low, high = midpoint(box) - radius(box) - 1e-15, midpoint(box) + radius(box) + 1e-15
    corners = centre + 0.01 * np.array(np.meshgrid(*[[-1, 0, 1]] * 3)).reshape(3, -1).T
    inside = integrator.step(PENDULUM, 0.3, corners, 0.125)
    assert np.all((low <= inside) & (inside <= high))
    assert radius(box).max() < 0.05
