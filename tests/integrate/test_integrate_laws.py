"""Laws of the fixed-step methods: stability, invariants, symmetry; and failures that say what to do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from flint import arb

from robot_dyn import RobotDynError
from robot_dyn.foundations import Ball, OverflowedError
from robot_dyn.integrate import GaussLegendre, IntegrationError, Integrator, Rosenbrock, RosenbrockTable, System, method
from robot_dyn.integrate.primitives import MAX_ITERATIONS
from tests.integrate.test_integrate import ALL, OSCILLATOR, PENDULUM, RNG, STIFF, name_of, oscillator, pendulum
from tests.long import long


def stiff_rate(t: Any, y: np.ndarray) -> np.ndarray:
    """Of y' = λ (y − cos t), λ = −1e6: after 1e-5 the solution is cos t to 1e-6. [Prothero and Robinson, 1974]."""
    return -1e6 * (y - np.cos(t))


@pytest.mark.parametrize("integrator", STIFF, ids=name_of)
def test_l_stable_methods_follow_the_slow_motion(integrator: Integrator) -> None:
    """At h |λ| = 1e5, from a start far off, the fast part, 2, is damped by |R| = 13/(h |λ|) or less."""
    y, h = np.array([3.0]), 0.1
    for i in range(20):
        y = integrator.step(System(stiff_rate, 0), i * h, y, h)
        assert abs(y[0] - np.cos((i + 1) * h)) < (3e-4 if i == 0 else 2e-6)


@pytest.mark.parametrize("name", ["Euler", "SemiImplicitEuler", "Midpoint", "RK4", "DP8"])
def test_explicit_methods_blow_up_on_a_stiff_system(name: str) -> None:
    y, h = np.array([1.5]), 0.1
    for i in range(4):
        y = method(name).step(System(stiff_rate, 0), i * h, y, h)
    assert abs(y[0]) > 1e15


def test_explicit_euler_gains_energy_by_1_plus_h2_a_step() -> None:
    """E_n = (1 + h²)ⁿ E_0 for the oscillator, exactly: in balls, with a radius that leaves nothing else."""
    ball, h, n = Ball(200), 0.125, 100
    with ball.scope():
        y = ball.array([0.75, -0.5])
        start = y @ y
        for i in range(n):
            y = method("Euler").step(OSCILLATOR, i * h, y, h)
        gain = (y @ y) / start - (1 + arb(h) ** 2) ** n
        assert gain.contains(arb(0))
        assert float(gain.rad()) < 1e-50


@pytest.mark.parametrize("order", [4, *long([2, 6])])
def test_gauss_keeps_a_quadratic_invariant_to_rounding(order: int) -> None:
    """q² + p² over 2000 steps: a rounding of u = 1.1e-16 each, that adds up to √n u if without sign, n u if with.

    The coefficients are rounded once for all steps, so some part has a sign: u n / 10 = 2e-14 allows no more. Runs of
    10⁷ steps are hard cases.
    """
    J = np.array([[0.0, -1.0], [1.0, 0.0]])
    system, integrator = System(lambda t, y: y @ J, 1), GaussLegendre(order)
    start = y = np.array([0.8, 0.6])
    for i in range(2000):
        y = integrator.step(system, i * 0.05, y, 0.05)
    assert abs(y @ y - start @ start) < 2e-14


@pytest.mark.parametrize("integrator", [each for each in ALL if each.canonical], ids=name_of)
def test_symmetric_methods_go_back_the_way_they_came(integrator: Integrator) -> None:
    """Φ₋ₕ ∘ Φₕ = 1 [HLW, V.1], to a few roundings."""
    y = RNG.normal(size=3)
    there = integrator.step(PENDULUM, 0.3, y, 0.1)
    np.testing.assert_allclose(integrator.step(PENDULUM, 0.3 + 0.1, there, -0.1), y, atol=4e-15)


@pytest.mark.parametrize("integrator", [GaussLegendre(2), GaussLegendre(4), GaussLegendre(6)], ids=name_of)
def test_a_large_quadrature_does_not_end_the_iteration_of_the_others(integrator: Integrator) -> None:
    """Power in a unit 10¹² times smaller: q and v are the same to a few roundings."""
    large = System(lambda t, y: pendulum(t, y) * np.array([1, 1, 1e12]), 1)
    y = np.array([0.4, -0.7, 0.1])
    got, same = integrator.step(large, 0.3, y * [1, 1, 1e12], 0.1), integrator.step(PENDULUM, 0.3, y, 0.1)
    np.testing.assert_allclose(got[:2], same[:2], rtol=1e-15)


@pytest.mark.parametrize("integrator", [GaussLegendre(2), GaussLegendre(4)], ids=name_of)
def test_a_system_at_rest_stays_there(integrator: Integrator) -> None:
    """Even if its forces cancel only up to rounding, which never settles."""

    def noisy(t: Any, y: np.ndarray) -> np.ndarray:
        return np.stack([y[..., 1], 1e-15 * rng.normal(size=y[..., 0].shape)], axis=-1)

    rng = np.random.default_rng(1)
    assert np.abs(integrator.step(System(noisy, 1), 0.0, np.zeros(2), 0.1)).max() < 1e-14


def test_jacobian_of_a_batch() -> None:
    """Central differences: truncation and rounding of u^(2/3) = 4e-11, some ten times that allowed."""
    y = RNG.normal(size=(4, 2, 3))
    J = PENDULUM.jacobian(0.8, y)
    assert J.shape == (4, 2, 3, 3)
    expected = np.zeros_like(J)
    expected[..., 0, 1], expected[..., 1, 0], expected[..., 1, 1], expected[..., 2, 1] = (
        1,
        -np.cos(y[..., 0]),
        -0.2,
        0.2,
    )
    np.testing.assert_allclose(J, expected, atol=5e-10)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_gauss_says_when_the_step_is_too_large(order: int) -> None:
    for h in (5.0, 50.0):
        with pytest.raises(
            IntegrationError, match=rf"GaussLegendre{order}: .* at t = 0.3 .* use a smaller step"
        ) as caught:
            GaussLegendre(order).step(OSCILLATOR, 0.3, np.array([1.0, 0.5]), h)
        assert caught.value.t == 0.3
        assert isinstance(caught.value, RobotDynError)
    with Ball(100).scope(), pytest.raises(IntegrationError, match="smaller step"):
        GaussLegendre(order).step(OSCILLATOR, 0.3, Ball(100).array([1.0, 0.5]), 5.0)


def test_gauss_converges_where_increments_shrink_every_second_round() -> None:
    """For q' = v, v' = −10⁴ q at h = 0.01: the increments of v are 10² times those of q, but h ω ‖A‖ < 1."""
    system = System(lambda t, y: np.stack([y[..., 1], -1e4 * y[..., 0]], axis=-1), 1)
    y = GaussLegendre(6).step(system, 0.0, np.array([1.0, 3.0]), 0.01)
    np.testing.assert_allclose(y, [np.cos(1) + 0.03 * np.sin(1), 3 * np.cos(1) - 100 * np.sin(1)], rtol=1e-4)


@pytest.mark.parametrize("integrator", [GaussLegendre(2), GaussLegendre(4)], ids=name_of)
def test_iteration_that_overflows_is_an_integration_error(integrator: Integrator) -> None:
    """From floats that become infinite, and from a rate that says so itself."""

    def quartic(t: Any, y: np.ndarray) -> np.ndarray:
        return y**4 + 1

    def refusing(t: Any, y: np.ndarray) -> np.ndarray:
        if np.abs(y).max() > 1e6:
            raise OverflowedError("too large")
        return quartic(t, y)

    for rate in (quartic, refusing):
        with pytest.raises(IntegrationError, match="smaller step"):
            integrator.step(System(rate, 0), 0.0, np.array([2.0]), 3.0)


def test_singular_matrix_of_an_implicit_step_is_an_integration_error() -> None:
    """For f = y, 1 − h γ J = 0 at h = 1/γ, exactly where γ is a power of 2."""
    gamma = 0.25
    table = RosenbrockTable(
        gamma, a=((),), c=((),), m=(4.0,), alpha=(0.0,), gammas=(gamma,), dense=((0.0,),) * 3, order=1
    )
    with pytest.raises(IntegrationError, match=r"singular for the step 4\.0"):
        Rosenbrock("own", table).step(System(lambda t, y: 1 * y, 0), 0.0, np.zeros(1), 4.0)


def test_iterations_are_bounded() -> None:
    calls: list[Any] = []

    def slow(t: Any, y: np.ndarray) -> np.ndarray:
        calls.append(t)
        return oscillator(t, y)

    with pytest.raises(IntegrationError):
        GaussLegendre(2).step(System(slow, 1), 0.0, np.array([1.0, 0.5]), 1.9)
    assert len(calls) == MAX_ITERATIONS
