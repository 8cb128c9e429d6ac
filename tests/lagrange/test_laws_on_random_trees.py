"""Laws of Lagrangian mechanics, and the agreement of the implementations, on random trees."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robot_dyn as rd
from robot_dyn.cross_check import random_state
from robot_dyn.lagrange import magnitudes, unit_diagonal_condition
from tests.long import stress
from tests.random_trees import RandomTree, trees

U = np.finfo(float).eps / 2
SEEDS = st.integers(0, 2**32 - 1)


def state_of(robot: rd.Robot, seed: int) -> list[np.ndarray]:
    """q, v, a of a general state."""
    state = random_state(robot, np.random.default_rng(seed))
    return [state[name] for name in ("q", "v", "a")]


def law(few: int, many: int) -> Callable[[Callable[[RandomTree, int], None]], Callable[[int], None]]:
    """A law that is held on a few random trees and seeds, and, as a stress test, on many."""

    def over(check: Callable[[RandomTree, int], None]) -> Callable[[int], None]:
        @pytest.mark.parametrize("examples", [few, *stress([many])])
        def test(examples: int) -> None:
            settings(max_examples=examples)(given(trees(), SEEDS)(check))()

        test.__doc__ = check.__doc__
        return test

    return over


@law(12, 80)
def test_the_implementations_agree(tree: RandomTree, seed: int) -> None:
    """All quantities within 1e-12 of the terms added into them; forward dynamics within 8 n u κ."""
    result = rd.compare(tree.robot, samples=2, seed=seed)
    assert result.ok, result.worst


@law(8, 40)
def test_mass_matrix_is_symmetric_positive_definite(tree: RandomTree, seed: int) -> None:
    """Both implementations. Symmetric to u on the scale of the entry; least eigenvalue of D M D above its rounding."""
    robot = tree.robot
    q, *_ = state_of(robot, seed)
    for engine in (robot, rd.Lagrangian(robot)):
        M = engine.M(q)
        scale = np.sqrt(np.outer(np.diag(M), np.diag(M)))
        assert np.all(np.abs(M - M.T) <= 1e-13 * scale)
        assert np.linalg.eigvalsh(M / scale)[0] > 8 * robot.n * U
        assert unit_diagonal_condition(M) < 1e14


@law(8, 40)
def test_rate_of_mass_matrix_is_coriolis_plus_its_transpose(tree: RandomTree, seed: int) -> None:
    """Ṁ = C + Cᵀ with Ṁ from the exact ∂M/∂q, and C of either implementation; u · terms, so 1e-13 of them."""
    robot = tree.robot
    q, v, _ = state_of(robot, seed)
    own = rd.Lagrangian(robot)
    rate = own.mass_matrix_derivative(q) @ v
    scale = magnitudes(own.linkage, q).C(v)
    for engine in (robot, own):
        C = engine.C(q, v)
        assert np.all(np.abs(C + C.T - rate) <= 1e-13 * (scale + scale.T))


@law(8, 40)
def test_derivative_of_mass_matrix_is_that_of_differences(tree: RandomTree, seed: int) -> None:
    """∂M/∂q against central differences of Pinocchio's M: error O(h²) and u/h, h = 1e-5 allows 1e-8 of the terms."""
    robot = tree.robot
    q, *_ = state_of(robot, seed)
    own, h = rd.Lagrangian(robot), 1e-5
    steps = h * np.eye(robot.n)
    differences = np.moveaxis((robot.M(q + steps) - robot.M(q - steps)) / (2 * h), 0, -1)
    size = magnitudes(own.linkage, q)
    allowed = 1e-8 * (size.dM + size.M[:, :, None])
    assert np.all(np.abs(own.mass_matrix_derivative(q) - differences) <= allowed)


@law(8, 40)
def test_momentum_is_the_derivative_of_kinetic_energy(tree: RandomTree, seed: int) -> None:
    """∂K/∂v = M v: K is quadratic in v, so the central difference with h = 1 is exact but for rounding.

    K is taken in longdouble: its rounding, n u of all terms, would hide the momentum of a small joint in float64.
    """
    robot = tree.robot
    q, v, _ = state_of(robot, seed)
    wide, steps = rd.Lagrangian(robot, np.longdouble), np.eye(robot.n)
    slope = (wide.kinetic_energy(q, v + steps) - wide.kinetic_energy(q, v - steps)) / 2
    M = magnitudes(rd.Lagrangian(robot).linkage, q).M
    speed = np.abs(v) + 1
    allowed = 1e-12 * M @ np.abs(v) + 100 * np.finfo(np.longdouble).eps * (speed @ M @ speed)
    for engine in (robot, rd.Lagrangian(robot)):
        assert np.all(np.abs(slope - engine.momentum(q, v)) <= allowed)


@law(8, 40)
def test_power_of_gravity_is_the_loss_of_potential_energy(tree: RandomTree, seed: int) -> None:
    """−N·v = −dV/dt. Central difference in longdouble, h = 1e-6: O(h²) = 1e-12 and u V/h = 1e-13 of the terms."""
    robot = tree.robot
    q, v, _ = state_of(robot, seed)
    own, h = rd.Lagrangian(robot, np.longdouble), np.longdouble(1e-6)
    rate = (own.potential_energy(q + h * v) - own.potential_energy(q - h * v)) / (2 * h)
    size = magnitudes(rd.Lagrangian(robot).linkage, q)
    speed = 1 + np.abs(v).sum()
    for engine in (robot, own):
        assert abs(engine.N(q) @ v - rate) <= 1e-12 * speed**3 * (size.V + size.N.sum())


@law(8, 40)
def test_kinetic_energy_gains_the_power_of_the_joints_and_gravity(tree: RandomTree, seed: int) -> None:
    """d/dt ½ vᵀ M v = vᵀ (τ − N) along any motion: vᵀ (M a + ½ Ṁ v) = vᵀ (ID − N); C's skew part does no work."""
    robot = tree.robot
    q, v, a = state_of(robot, seed)
    own = rd.Lagrangian(robot)
    rate = v @ (own.M(q) @ a + own.mass_matrix_derivative(q) @ v @ v / 2)
    power = v @ (robot.inverse_dynamics(q, v, a) - robot.N(q))
    terms = np.abs(v) @ magnitudes(own.linkage, q).inverse_dynamics(v, a)
    assert abs(rate - power) <= 1e-12 * terms


@law(8, 40)
def test_jacobian_maps_joint_rates_to_the_motion_of_a_frame(tree: RandomTree, seed: int) -> None:
    """ṗ of the placement by central difference, h = 1e-6, is the linear part of J v: O(h²) and u/h, so 1e-8."""
    robot = tree.robot
    q, v, _ = state_of(robot, seed)
    frame, h = robot.frame_names[-1], 1e-6
    rate = (robot.placement(q + h * v, frame) - robot.placement(q - h * v, frame))[:3, 3] / (2 * h)
    terms = magnitudes(rd.Lagrangian(robot).linkage, q).lever[frame] @ np.abs(v)
    assert np.all(np.abs(robot.jacobian(q, frame)[:3] @ v - rate) <= 1e-8 * (1 + terms) * (1 + np.abs(v).sum()) ** 2)


@law(8, 40)
def test_magnitudes_bound_their_quantities(tree: RandomTree, seed: int) -> None:
    """No sum exceeds the sum of the sizes of its terms; 1e-12 for rounding where the bound is attained."""
    robot = tree.robot
    q, v, a = state_of(robot, seed)
    own = rd.Lagrangian(robot)
    size = magnitudes(own.linkage, q)
    pairs = [
        (own.M(q), size.M),
        (own.mass_matrix_derivative(q), size.dM),
        (own.C(q, v), size.C(v)),
        (own.N(q), size.N),
        (own.potential_energy(q), size.V),
        (own.inverse_dynamics(q, v, a), size.inverse_dynamics(v, a)),
    ]
    for value, bound in pairs:
        assert np.all(np.abs(value) <= bound * (1 + 1e-12) + 1e-300)
