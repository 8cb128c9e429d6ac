"""The recursions over the bodies against the closed form: two implementations to the same numbers, in float64."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import block_diagonal
from robot_dyn.lagrange import composite_body, newton_euler
from robot_dyn.lagrange.recursions.kinetic_energy import kinetic_energy
from robot_dyn.lagrange.recursions.propagation import accelerations, twists

ROBOTS = ("planar_2r", "ur5", "mimic_chain", "skew_tree", "cart_pole")


@pytest.fixture(params=ROBOTS)
def lagrangian(request: pytest.FixtureRequest) -> rd.Lagrangian:
    return rd.Lagrangian(rd.load(request.param))


@pytest.fixture
def state(lagrangian: rd.Lagrangian) -> np.ndarray:
    """q, v, a without zeros."""
    return np.random.default_rng(3).uniform(0.2, 1.5, (3, lagrangian.n)) * [[1], [-1], [1]]


def test_velocities_and_accelerations_are_those_of_the_jacobians(lagrangian: rd.Lagrangian, state: np.ndarray) -> None:
    """V_i = Jᵢ v, and R A_i = J a + J̇ v of the joint's frame along the base's axes; 1e-13 of the largest."""
    q, v, a = state
    linkage = lagrangian.linkage
    X, full_v, full_a = linkage.steps(q), linkage.couplings.velocity(v), linkage.couplings.velocity(a)
    V = twists(linkage, X, full_v)
    A = accelerations(linkage, X, V, full_v, full_a, np.zeros(6))
    for body, twist, acceleration in zip(linkage.bodies, V, A, strict=True):
        assert np.allclose(twist, lagrangian.jacobian(q, body.joint, expressed_in="body") @ v, rtol=0, atol=1e-13)
        R = block_diagonal(lagrangian.placement(q, body.joint)[:3, :3])
        of_frame = lagrangian.jacobian(q, body.joint) @ a + lagrangian.jacobian_rate(q, v, body.joint) @ v
        assert np.allclose(R @ acceleration, of_frame, rtol=0, atol=1e-13 * (1 + np.max(np.abs(of_frame))))


def test_newton_euler_is_the_closed_form(lagrangian: rd.Lagrangian, state: np.ndarray) -> None:
    """τ = M a + C v + N, and M a + C v without gravity; a few hundred roundings, so 1e-12 of the largest torque."""
    q, v, a = state
    expected = lagrangian.inverse_dynamics(q, v, a)
    size = np.max(np.abs(expected)) + np.max(np.abs(lagrangian.N(q)))
    assert np.max(np.abs(newton_euler(lagrangian.linkage, q, v, a) - expected)) <= 1e-12 * size
    free = newton_euler(lagrangian.linkage, q, v, a, gravity=False)
    assert np.max(np.abs(free + lagrangian.N(q) - expected)) <= 1e-12 * size


def test_composite_bodies_make_the_mass_matrix(lagrangian: rd.Lagrangian, state: np.ndarray) -> None:
    """M = Σ Jᵢᵀ 𝓜ᵢ Jᵢ to 1e-13 of its largest entry."""
    expected = lagrangian.M(state[0])
    assert np.max(np.abs(composite_body(lagrangian.linkage, state[0]) - expected)) <= 1e-13 * np.max(np.abs(expected))


def test_the_energies_of_the_bodies_add_up(lagrangian: rd.Lagrangian, state: np.ndarray) -> None:
    """K = ½ vᵀ M v: all terms are positive in the sum over the bodies, so 1e-13 of it."""
    q, v, _ = state
    expected = lagrangian.kinetic_energy(q, v)
    assert abs(kinetic_energy(lagrangian.linkage, q, v) - expected) <= 1e-13 * expected
