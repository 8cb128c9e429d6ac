"""Linearisation about a state: d/dt (δq, δv) = A (δq, δv) + B δu."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from tests.slides import slides

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
        u = plant.inverse_dynamics(*held, np.zeros(2), t=0.0)
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
    law = rd.control.PDGravity(PANDA, rd.control.hold(q), kp=kp, kd=kd)
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
    held = rd.control.FeedForward(DOUBLE, rd.control.hold(q), kp=0.0, kd=0.0)  # N(q) at the reference: constant
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


def test_a_kink_has_no_linearisation() -> None:
    with pytest.raises(rd.RobotDynError, match="no derivative"):
        rd.linearise(rd.Plant(rd.load("pendulum"), [rd.effects.EffortLimit(5.0)]), [0.1], [0.0], [5.0])


@pytest.mark.parametrize("velocity", [0.0, 1e-3, 1.0, 30.0])
@pytest.mark.parametrize("scale", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8])
def test_thin_layers_of_friction_are_resolved(scale: float, velocity: float) -> None:
    """∂a/∂v = −f/(v_s I) sech²(v/v_s), I = 1/3; 1e-9 of the slope at rest is 100 times what differences leave."""
    plant = rd.Plant(PENDULUM, [rd.effects.RegularisedCoulombFriction(0.1, scale)])
    A, _ = rd.linearise(plant, [0.1], [velocity * scale], [0.0])
    assert A[1, 1] == pytest.approx(-0.3 / scale / np.cosh(velocity) ** 2, abs=1e-9 * 0.3 / scale)


SLIDES = slides(("ja", "base", "a", 2.0), ("jb", "a", "b", 2.0))


@pytest.mark.parametrize("q", [[0.5, 0.3], [1e5, -3e5]])
@pytest.mark.parametrize("stiffness", [1.0, 1e8, 1e12])
def test_stiff_springs_and_far_slides_are_linearised(stiffness: float, q: list[float]) -> None:
    """a₁ = (u₁ − u₂ − K q₁ + k q₂)/m, a₂ = (2 u₂ − u₁ + K q₁ − 2 k q₂)/m: forces of 1e17 N leave 1e-10 of K."""
    plant = rd.Plant(SLIDES, [rd.effects.Spring([stiffness, 1.0])])
    A, _ = rd.linearise(plant, q, u=[0.0, 0.0])
    expected = [[-stiffness / 2, 0.5], [stiffness / 2, -1.0]]
    np.testing.assert_allclose(A[2:, :2], expected, atol=1e-10 * stiffness * max(1.0, np.abs(q).max()))


@pytest.mark.parametrize("distance", [1e-9, -1e-9])
def test_a_kink_nearby_does_not_change_the_slope(distance: float) -> None:
    """A stop 1e-9 rad away: the slope is that of the side of the state, −3 (k + m g l/2 cos q); 1e-6 of it is left."""
    stops = rd.effects.joint_stops(-1.0, 1.0, 1e4, 0.0)
    A, _ = rd.linearise(rd.Plant(PENDULUM, stops), [1.0 + distance], [0.0], [0.0])
    stiffness = 1e4 if distance > 0 else 0.0
    assert A[1, 0] == pytest.approx(-3 * (stiffness + G / 2 * np.cos(1.0)), rel=1e-6)


def test_dry_friction_slides_and_is_named_where_it_holds() -> None:
    """−f sign(v) has no slope while the joint slides, however slowly."""
    plant = rd.Plant(DOUBLE, [rd.effects.DryFriction([0.0, 1.0])])
    q, u = [0.3, -0.4], [1.0, 2.0]
    bare = rd.linearise(DOUBLE, q, [0.0, 1e-9], u)
    np.testing.assert_allclose(rd.linearise(plant, q, [0.0, 1e-9], u).A[2:, 2:], bare.A[2:, 2:], atol=1e-8)
    with pytest.raises(QueryError) as refused:
        rd.linearise(plant, q)
    assert all(part in str(refused.value) for part in ("dry_friction", "joint_2", "RegularisedCoulombFriction"))
    assert "joint_1" not in str(refused.value)


@pytest.mark.parametrize(
    ("effects", "state", "parts"),
    [
        ([rd.effects.EffortLimit(5.0)], ([0.1], [0.0], [5.0]), ("effort_limit", "pivot", "5")),
        (rd.effects.joint_stops(-1.0, 1.0), ([1.0],), ("joint_stops", "pivot", "1")),
        ([rd.effects.RigidStops(-1.0, 1.0)], ([1.0],), ("rigid_stops", "pivot")),
        ([rd.effects.RigidBacklash(1e-3, 1e-4, 100.0)], ([1.0],), ("rigid_backlash", "SeriesElastic")),
    ],
)
def test_what_has_no_derivative_is_named(effects, state, parts) -> None:
    with pytest.raises(QueryError) as refused:
        rd.linearise(rd.Plant(PENDULUM, effects), *state)
    assert all(part in str(refused.value) for part in parts)


def test_a_lag_is_a_state_of_its_own() -> None:
    """The lag has z' = (u − z)/T, and I a = z − (m g l/2) sin q; differences leave 1e-10."""
    T, q = 0.02, 0.7
    system = rd.linearise(rd.Plant(PENDULUM, [rd.effects.ActuatorLag(T)]), [q])
    stiffness = 3 * G / 2 * np.cos(q)
    expected = [[0.0, 1.0, 0.0], [-stiffness, 0.0, 3.0], [0.0, 0.0, -1 / T]]
    np.testing.assert_allclose(system.A, expected, atol=1e-9)
    np.testing.assert_allclose(system.B, [[0.0], [0.0], [1 / T]], atol=1e-9)
    assert system.state_names == ("q pivot", "v pivot", "actuator_lag state 1") and system.input_names == ("u pivot",)
    held = G / 2 * np.sin(q)
    np.testing.assert_allclose([*system.q, *system.v, *system.z, *system.u], [q, 0.0, held, held], rtol=1e-12)


def test_series_elastic_joints_have_the_matrix_of_two_masses_and_a_spring() -> None:
    """I a = k δ + d (θ̇ − v) − m g l/2 sin q, δ̇ = θ̇ − v, n² J θ̈ = u − k δ − d (θ̇ − v) − b θ̇."""
    k, J, n, d, b, q = 1e4, 1e-4, 100.0, 2.0, 1.0, 0.3
    drive = rd.effects.SeriesElastic(k, J, n, damping=d, viscous=b)
    system = rd.linearise(rd.Plant(PENDULUM, [drive]), [q])
    bar, motor, load = 1 / 3, n**2 * J, G / 2 * np.sin(q)
    expected = [
        [0.0, 1.0, 0.0, 0.0],
        [-G / 2 * np.cos(q) / bar, -d / bar, k / bar, d / bar],
        [0.0, -1.0, 0.0, 1.0],
        [0.0, d / motor, -k / motor, -(d + b) / motor],
    ]
    np.testing.assert_allclose(system.A, expected, atol=1e-9 * k)
    np.testing.assert_allclose(system.B[:, 0], [0.0, 0.0, 0.0, 1 / motor], atol=1e-10)
    np.testing.assert_allclose(system.z, [load / k, 0.0], atol=1e-15)
    np.testing.assert_allclose(system.u, [load], rtol=1e-12)


def test_bristles_at_rest_are_a_spring_and_a_damper() -> None:
    """LuGre, z = 0: z' = v and τ = −σ₀ z − (σ₁ + σ₂) v; deflected bristles have a kink at v = 0, which is named."""
    plant = rd.Plant(PENDULUM, [rd.effects.LuGreFriction(1e5, 300.0, 0.4, 1.0, 1.5, 1e-3)])
    A, _ = rd.linearise(plant, [0.3])
    expected = [[0.0, 1.0, 0.0], [-3 * G / 2 * np.cos(0.3), -3 * 300.4, -3e5], [0.0, 1.0, 0.0]]
    np.testing.assert_allclose(A, expected, atol=1e-4)
    with pytest.raises(QueryError, match="lugre_friction"):
        rd.linearise(plant, [0.3], z=[1e-6])


@pytest.mark.parametrize(
    "effects",
    [
        [rd.effects.ActuatorLag(0.05)],
        [rd.effects.SeriesElastic([300.0, 90.0], 0.02, damping=2.0)],
        [rd.effects.LuGreFriction(200.0, 3.0, 0.4, 1.0, 1.5, 0.1)],
        [rd.effects.ActuatorLag([0.05, 0.1]), rd.effects.DahlFriction(50.0, 2.0)],
    ],
    ids=["lag", "elastic", "lugre", "lag and dahl"],
)
def test_a_small_deviation_with_states_moves_as_the_linearisation_says(effects) -> None:
    """Under PD, exp((A − B K) t) δ about rest without gravity; the error is of second order in δ, 1e-12, times 1e3."""
    arm, q, away = DOUBLE.with_(gravity=(0.0, 0.0, 0.0)), np.array([0.4, -0.7]), 1e-6 * np.array([0.6, -1.0, 0.8, 0.3])
    plant = rd.Plant(arm, effects)
    system = rd.linearise(plant, q)
    K = np.zeros((2, len(system.A)))
    K[:, :2], K[:, 2:4] = 20.0 * np.eye(2), 3.0 * np.eye(2)
    start = np.concatenate([away, plant.equation_of_motion.start(q + away[:2], away[2:])])
    run = rd.simulate(
        plant, q + away[:2], v0=away[2:], duration_s=0.3, controller=rd.control.PD(rd.control.hold(q), kp=20.0, kd=3.0),
        method=rd.integrate.Adaptive(rtol=1e-10, atol=1e-13), estimate_error=False,
    )  # fmt: skip
    moved = np.concatenate([run.q[-1] - q, run.v[-1], *(states[-1] for states in (run.effect_states or {}).values())])
    np.testing.assert_allclose(moved, expm(0.3 * (system.A - system.B @ K)) @ start, atol=1e-9)
