"""What the textbook tools refuse, each with its reason and remedy: energies, particles, bodies and solids."""

from __future__ import annotations

import math
from typing import Any, cast

import casadi as ca
import numpy as np
import pytest

from robot_dyn import RobotDynError, euler_lagrange
from robot_dyn.description import MassProperties, box, combined, cylinder, from_density
from robot_dyn.foundations import MissingTimeError, OverflowedError, QueryError, SingularError
from robot_dyn.lagrange import angular_momentum, body_acceleration, body_wrench, lagrangian_of_particles, world_wrench
from robot_dyn.lagrange.generalized_force import generalized_force

BODY = box(1.7, 0.3, 0.5, 0.8)
PENDULUM = euler_lagrange(lambda t, q, v: v[0] ** 2 / 2, lambda t, q: -9.81 * ca.cos(q[0]), 1)
NAN, ZERO = np.array([np.nan]), np.zeros(1)


def unit_mass(t, q, v):
    return ca.sumsqr(v) / 2


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: euler_lagrange(unit_mass, None, 0), "n, the number of coordinates, must be a whole number"),
        (lambda: euler_lagrange(lambda t, q, v: q[3], None, 1), r"K\(t, q, v\) cannot be evaluated .*casadi.sin"),
        (lambda: euler_lagrange(lambda t, q, v: v, None, 2), r"K\(t, q, v\) must have shape \(1, 1\), got \(2, 1\)"),
        (lambda: euler_lagrange(lambda t, q, v: "½ m v²", None, 1), "cannot be evaluated"),
        (lambda: euler_lagrange(lambda t, q, v: ca.SX.sym("m") * v[0] ** 2, None, 1), "cannot be evaluated"),
        (lambda: euler_lagrange(unit_mass, lambda t, q: math.cos(q[0]), 1), "not finite; use casadi.sin"),
        (lambda: euler_lagrange(unit_mass, cast(Any, lambda t: t), 1), r"V\(t, q\) cannot be evaluated"),
        (lambda: PENDULUM.M([1.0, 2.0], ZERO), r"q must have shape \(1,\) or \(..., 1\), got \(2,\)"),
        (lambda: PENDULUM.M(NAN, ZERO), "q must be finite, got nan"),
        (lambda: PENDULUM.bias(ZERO, ZERO, t=np.inf), "t must be finite, got inf"),
        (lambda: PENDULUM.forward_dynamics(ZERO, ZERO, "much"), "Q must be an array of real numbers"),
        (lambda: PENDULUM.bias(np.zeros((2, 1)), np.zeros((3, 1))), "batch axes of v"),
        (lambda: PENDULUM.inverse_dynamics(ZERO, ZERO, np.zeros((3, 1)), t=np.zeros(2)), "batch axes of a"),
        (lambda: generalized_force(lambda t, q: [q], 2), r"position 0 must have shape \(3, 1\)"),
        (lambda: generalized_force(lambda t, q: [], 2), "at least one particle"),
        (lambda: generalized_force(lambda t, q: q[7], 2), "cannot be evaluated"),
        (lambda: generalized_force(lambda t, q: [q], 3)(0.0, np.zeros(3), np.zeros((2, 3))), "forces must have shape"),
        (lambda: lagrangian_of_particles([1.0, 2.0], lambda t, q: [q], 3), "2 masses but 1 positions"),
        (lambda: lagrangian_of_particles([-1.0], lambda t, q: [q], 3), "masses must be positive"),
        (lambda: MassProperties(0.0, np.zeros(3), np.eye(3)), "mass must be positive"),
        (lambda: MassProperties(1.0, np.zeros(3), np.diag([1.0, 1.0, 3.0])), "triangle inequality"),
        (lambda: MassProperties(1.0, np.zeros(3), np.triu(np.ones((3, 3)))), "symmetric"),
        (lambda: MassProperties(cast(Any, np.ones(2)), np.zeros(3), np.eye(3)), "mass must be one number"),
        (lambda: BODY.moved(2 * np.eye(3), np.zeros(3)), "R must be a rotation"),
        (lambda: BODY.moved(-np.eye(3), np.zeros(3)), "R must be a rotation"),
        (lambda: combined([]), "no bodies"),
        (lambda: box(1.0, 0.1, -0.2, 0.3), "ly must be positive"),
        (lambda: box(1.0, 1e200, 0.2, 0.3), "inertia must be finite"),
        (lambda: cylinder(np.nan, 0.1, 0.2), "mass must be finite"),
        (lambda: from_density(lambda x: x, np.zeros(3), np.ones(3)), r"must be one number or of shape"),
        (lambda: from_density(lambda x: x[:, 0] - 1, np.zeros(3), np.ones(3)), "must not be negative"),
        (lambda: from_density(lambda x: 0.0, np.zeros(3), np.ones(3)), "no centre of mass"),
        (lambda: from_density(lambda x: 1.0, np.ones(3), np.ones(3)), "lower < upper"),
        (lambda: from_density(lambda x: 1.0, np.zeros(3), np.ones(3), points=0), "points must be"),
        (lambda: from_density(lambda x: 1.0, np.zeros(3), np.ones(3), chart=cast(Any, lambda u: u)), "chart must map"),
        (lambda: body_wrench(BODY, np.zeros(3), np.zeros(6)), r"twist must have shape \(6,\)"),
        (lambda: world_wrench(BODY, np.zeros((3, 3)), np.zeros(3), np.zeros(6)), "R must be a rotation"),
        (lambda: angular_momentum(BODY, np.stack([np.eye(3)] * 2), np.zeros((3, 3))), "batch axes do not match"),
        (
            lambda: body_acceleration(MassProperties(1.0, np.zeros(3), np.diag([0, 1.0, 1.0])), np.ones(6), np.ones(6)),
            "inertia is singular",
        ),
    ],
)
def test_bad_input_is_refused(make, message: str) -> None:
    with pytest.raises(QueryError, match=message):
        make()


def test_no_coriolis_matrix_for_terms_linear_in_v() -> None:
    """A charge in a magnetic field, K = ½ v² + B × q · v / 2: b is gyroscopic, and M alone does not give it."""
    charge = euler_lagrange(lambda t, q, v: unit_mass(t, q, v) + q[0] * v[1] - q[1] * v[0], None, 2)
    with pytest.raises(RobotDynError, match=r"linear.*use bias\(q, v\)"):
        charge.C([0.1, 0.2], [0.3, 0.4])
    np.testing.assert_allclose(charge.bias([0.1, 0.2], [0.3, 0.4]), [-0.8, 0.6], rtol=1e-15)


def test_singular_states_are_named() -> None:
    """Polar coordinates at r = 0 have no inertia in the angle; 1/q has no value at 0."""
    polar = euler_lagrange(lambda t, q, v: (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2, None, 2)
    with pytest.raises(SingularError, match=r"q\[1\].*other coordinates"):
        polar.forward_dynamics([0.0, 1.0], [1.0, 1.0], [0.0, 0.0])
    newton = euler_lagrange(unit_mass, lambda t, q: -1 / q[0], 1)
    with pytest.raises(OverflowedError, match="singular at this state"):
        newton.forward_dynamics([0.0], [1.0], [0.0])
    with pytest.raises(OverflowedError, match="too large"):
        body_wrench(BODY, np.full(6, 1e200), np.zeros(6))


def test_batches_are_the_states_one_by_one() -> None:
    rng = np.random.default_rng(4)
    arm = euler_lagrange(lambda t, q, v: (1 + t**2) * (2 + ca.cos(q[1])) * v[0] ** 2 + v[1] ** 2, None, 2)
    t, q, v = rng.normal(size=(4, 1)), rng.normal(size=(4, 3, 2)), rng.normal(size=(3, 2))
    got = arm.bias(q, v, t=t)
    assert got.shape == (4, 3, 2)
    one_by_one = [[arm.bias(q[i, j], v[j], t=t[i, 0]) for j in range(3)] for i in range(4)]
    np.testing.assert_array_equal(got, one_by_one)
    assert arm.M(np.zeros((0, 2)), np.zeros(2), t=0.0).shape == (0, 2, 2)
    assert arm.energy(q, v, t=0.0).shape == (4, 3)


def test_a_missing_time_is_an_error_only_if_the_result_depends_on_it() -> None:
    q, v, a = np.random.default_rng(5).normal(size=(3, 2))
    growing = euler_lagrange(lambda t, q, v: (1 + t**2) * unit_mass(t, q, v), lambda t, q: q[0] ** 2, 2)
    np.testing.assert_array_equal(growing.N(q), growing.N(q, t=3.0))
    for query in (growing.M, growing.bias, growing.momentum, growing.energy, growing.jacobi_integral):
        with pytest.raises(MissingTimeError):
            query(q, v)
    for query in (growing.inverse_dynamics, growing.forward_dynamics):
        with pytest.raises(MissingTimeError):
            query(q, v, a)
    fixed = euler_lagrange(unit_mass, lambda t, q: t * q[0], 2)
    np.testing.assert_array_equal(fixed.M(q, v), fixed.M(q, v, t=3.0))
    with pytest.raises(MissingTimeError):
        fixed.N(q)


def test_the_energy_of_a_system_at_rest_in_time_is_its_jacobi_integral() -> None:
    """K + V = h where K = ½ vᵀ M v; a constraint that moves adds terms to K that are not quadratic in v."""
    rng = np.random.default_rng(7)
    q, v = rng.normal(size=(2, 20, 2))

    def potential(t: Any, q: Any) -> Any:
        return 9.81 * ca.cos(q[0]) + 2 * q[1] ** 2

    fixed = euler_lagrange(lambda t, q, v: (2 + ca.cos(q[1])) * v[0] ** 2 + v[1] ** 2, potential, 2)
    expected = (2 + np.cos(q[:, 1])) * v[:, 0] ** 2 + v[:, 1] ** 2 + 9.81 * np.cos(q[:, 0]) + 2 * q[:, 1] ** 2
    np.testing.assert_allclose(fixed.energy(q, v), expected, rtol=1e-14, atol=1e-13)  # rounding of terms up to 50
    np.testing.assert_allclose(fixed.jacobi_integral(q, v), expected, rtol=1e-14, atol=1e-13)
    moving = euler_lagrange(lambda t, q, v: (v[0] + 3.0) ** 2 + v[1] ** 2, potential, 2)
    assert np.abs(moving.energy(q, v) - moving.jacobi_integral(q, v)).min() > 1.0
