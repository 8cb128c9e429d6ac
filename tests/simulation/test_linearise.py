"""Linearisation about a state: d/dt (δq, δv) = A (δq, δv) + B δu."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import robot_dyn as rd
from robot_dyn.foundations.errors import QueryError

G = 9.80665
PENDULUM = rd.load("pendulum")  # I = 1/3 kg m², m g l/2 = G/2
DOUBLE = rd.load("planar_2r")
PANDA = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})


@pytest.mark.parametrize("q", [0.0, 0.7, 2.9, np.pi])
def test_pendulum_with_friction_and_spring(q: float) -> None:
    """I a = u − b v − k (q − q₀) − (m g l/2) sin q, whose slopes are these; Richardson's differences leave 1e-10."""
    b, k = 0.3, 0.8
    plant = rd.Plant(PENDULUM, [rd.effects.ViscousFriction(b), rd.effects.Spring(k, 0.4)])
    A, B = rd.linearise(plant, [q], [0.6], [1.3])
    np.testing.assert_allclose(A, [[0.0, 1.0], [-3 * (G / 2 * np.cos(q) + k), -3 * b]], atol=1e-10)
    np.testing.assert_allclose(B, [[0.0], [3.0]], atol=1e-10)


@pytest.mark.parametrize("q", [0.7, 2.9])
def test_a_robot_by_itself_is_linearised_at_rest_in_equilibrium(q: float) -> None:
    """I δ'' = δu − (m g l/2) cos q δ: the actuation that holds the rod takes no part in it; differences leave 1e-10."""
    A, B = rd.linearise(PENDULUM, [q])
    np.testing.assert_allclose(A, [[0.0, 1.0], [-3 * G / 2 * np.cos(q), 0.0]], atol=1e-10)
    np.testing.assert_allclose(B, [[0.0], [3.0]], atol=1e-10)


def test_defaults_are_rest_and_the_actuation_without_acceleration() -> None:
    q, v = np.random.default_rng(8).normal(size=(2, 2))
    plant = rd.Plant(DOUBLE, [rd.effects.ViscousFriction(0.3), rd.effects.Spring(2.0)])
    for given, held in (((q,), (q, 0 * q)), ((q, v), (q, v))):
        u = plant.inverse_dynamics(0.0, *held, np.zeros(2))
        for one, two in zip(rd.linearise(plant, *given), rd.linearise(plant, *held, u), strict=True):
            np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("robot", [DOUBLE, PANDA, rd.load("skew_tree")], ids=lambda each: each.name)
def test_B_is_the_inverse_of_M_and_A_starts_with_what_is_kinematics(robot) -> None:
    """A is linear in u, so B has no truncation: rounding of a over the step of 1e-3, 1e-10 of the largest entry."""
    q, v, u = np.random.default_rng(4).normal(size=(3, robot.n))
    A, B = rd.linearise(rd.Plant(robot), q, v, u)
    n, inverse = robot.n, np.linalg.inv(robot.M(q))
    np.testing.assert_allclose(B[n:], inverse, atol=1e-10 * np.abs(inverse).max())
    np.testing.assert_array_equal(B[:n], np.zeros((n, n)))
    np.testing.assert_array_equal(A[:n], np.hstack([np.zeros((n, n)), np.eye(n)]))


@pytest.mark.parametrize("robot", [DOUBLE, PANDA], ids=lambda each: each.name)
def test_slopes_of_the_acceleration_are_those_of_its_equation(robot) -> None:
    """∂a/∂v = −M⁻¹ ∂(C v)/∂v, C v quadratic in v, exact by one difference; ∂a/∂q at rest = −M⁻¹ ∂N/∂q where a = 0."""
    n, (q, v) = robot.n, np.random.default_rng(5).normal(size=(2, robot.n))
    A, _ = rd.linearise(rd.Plant(robot), q, v, np.zeros(n))
    difference = [robot.coriolis_torque(q, v + e) - robot.coriolis_torque(q, v - e) for e in 0.5 * np.eye(n)]
    expected = -np.linalg.solve(robot.M(q), np.transpose(difference))
    np.testing.assert_allclose(A[n:, n:], expected, atol=1e-9 * np.abs(expected).max())
    A, _ = rd.linearise(rd.Plant(robot), q, np.zeros(n), robot.N(q))
    h = 1e-5  # of a central difference: error h² and 1e-16/h of N, both 1e-9 at most
    stiffness = np.transpose([(robot.N(q + e) - robot.N(q - e)) / (2 * h) for e in h * np.eye(n)])
    expected = -np.linalg.solve(robot.M(q), stiffness)
    np.testing.assert_allclose(A[n:, :n], expected, atol=1e-6 * np.abs(expected).max())


def test_gravity_compensated_pd_has_the_eigenvalues_of_its_gains() -> None:
    """Then M ë + kd ė + kp e = 0 near rest, and the eigenvalues are the roots of det(s² M + s kd + kp)."""
    n, q, zero = 7, np.array([0.3, 0.6, -0.4, -1.2, 0.5, 1.1, 0.2]), np.zeros(7)
    kp, kd = np.linspace(900.0, 100.0, n), np.linspace(60.0, 9.0, n)
    law = rd.control.PDGravity(PANDA, rd.control.hold(q), kp, kd)
    A, B = rd.linearise(rd.Plant(PANDA), q, zero, law.torque(0.0, q, zero, np.zeros(0)))
    h = 1e-5
    feedback = np.zeros((n, 2 * n))
    for i, step in enumerate(h * np.eye(2 * n)):
        after, before = (law.torque(0.0, q + s * step[:n], s * step[n:], np.zeros(0)) for s in (1, -1))
        feedback[:, i] = (after - before) / (2 * h)
    closed = np.linalg.eigvals(A + B @ feedback)
    M = PANDA.M(q)
    companion = np.block(
        [[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, np.diag(kp)), -np.linalg.solve(M, np.diag(kd))]]
    )
    expected = np.linalg.eigvals(companion)
    assert (closed.real < 0).all()
    np.testing.assert_allclose(np.sort_complex(closed), np.sort_complex(expected), rtol=1e-6)


def test_pd_on_the_pendulum_places_the_predicted_poles() -> None:
    """I s² + (b + kd) s + kp + (m g l/2) cos q = 0."""
    b, kp, kd, q = 0.3, 12.0, 1.1, 0.7
    A, B = rd.linearise(rd.Plant(PENDULUM, [rd.effects.ViscousFriction(b)]), [q], [0.0], [G / 2 * np.sin(q)])
    poles = np.linalg.eigvals(A - B @ [[kp, kd]])
    expected = np.roots([1 / 3, b + kd, kp + G / 2 * np.cos(q)])
    np.testing.assert_allclose(np.sort_complex(poles), np.sort_complex(expected), rtol=1e-10)


@pytest.mark.parametrize("size", [1e-4, 1e-5])
def test_a_small_deviation_moves_as_the_linearisation_says(size: float) -> None:
    """About an equilibrium under constant u: exp(A t) δ, with an error of the second order in δ."""
    q = np.array([0.4, -0.7])
    plant, u = rd.Plant(DOUBLE, [rd.effects.ViscousFriction([0.4, 0.2])]), DOUBLE.N(q)
    away = size * np.array([0.6, -1.0, 0.8, 0.3])
    A, _ = rd.linearise(plant, q, np.zeros(2), u)
    held = rd.control.FeedForward(DOUBLE, rd.control.hold(q), 0.0, 0.0)  # N(q) at the reference: constant
    run = rd.simulate(plant, q0=q + away[:2], v0=away[2:], duration_s=0.3, controller=held, estimate_error=False)
    np.testing.assert_allclose(run.u, np.tile(u, (len(run.t), 1)), rtol=1e-12)
    moved = np.concatenate([run.q[-1] - q, run.v[-1]])
    assert np.abs(moved - expm(0.3 * A) @ away).max() < 100 * size**2


def test_effects_and_time_are_taken_into_account() -> None:
    """A wrench that has ended adds nothing; while it acts, its torque Jᵀ F turns with the arm."""
    q, v, u = np.random.default_rng(6).normal(size=(3, 2))
    plant = rd.Plant(DOUBLE, [rd.effects.ExternalWrench("tip", [5.0, 0.0, -9.0, 0.0, -2.0, 0.0], end_s=1.0)])
    bare, _ = rd.linearise(rd.Plant(DOUBLE), q, v, u)
    after, _ = rd.linearise(plant, q, v, u, t=1.0)
    during, _ = rd.linearise(plant, q, v, u, t=0.5)
    np.testing.assert_array_equal(after, bare)
    assert np.abs(during - bare)[2:, :2].max() > 0.1


@pytest.mark.parametrize(
    ("state", "message"),
    [
        (([0.1], [0.0, 0.0], [0.0, 0.0]), r"q must have shape \(2,\)"),
        (([0.1, 0.2], [0.0, np.nan], [0.0, 0.0]), "v must be finite"),
        (([0.1, 0.2], [0.0, 0.0], "much"), "u must be"),
        ((np.zeros((3, 2)), np.zeros((3, 2)), np.zeros((3, 2))), "one state"),
    ],
    ids=["shape", "nan", "text", "batch"],
)
def test_a_state_without_meaning_is_refused(state, message: str) -> None:
    with pytest.raises(QueryError, match=message):
        rd.linearise(rd.Plant(DOUBLE), *state)


@pytest.mark.parametrize("scale", [1e-2, 1e-3, 1e-4])
def test_steep_friction_is_linearised_too(scale: float) -> None:
    """∂a/∂v = −f/(v_s M) at rest, M = 1/3: the step of the difference shrinks until two agree to 1e-6."""
    plant = rd.Plant(rd.load("pendulum"), [rd.effects.RegularisedCoulombFriction(0.1, scale)])
    A, _ = rd.linearise(plant, [0.1], [0.0], [0.0])
    assert A[1, 1] == pytest.approx(-0.3 / scale, rel=1e-6)


def test_a_kink_has_no_linearisation() -> None:
    with pytest.raises(rd.RobotDynError, match="no derivative"):
        rd.linearise(rd.Plant(rd.load("pendulum"), [rd.effects.EffortLimit(5.0)]), [0.1], [0.0], [5.0])
