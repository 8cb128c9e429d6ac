"""The systems of deck 001, one test a row of the equations, B1–B6, and closed forms of arms in both implementations."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robot_dyn as rd
from robot_dyn import RobotDynError, euler_lagrange
from robot_dyn.description import box, check, from_density
from robot_dyn.lagrange import EulerLagrange, lagrangian_of_particles
from robot_dyn.lagrange.generalized_force import generalized_force
from tests.chains import body, chain

COUNT = 200  # states of a test, as one batch
GRAVITY = 9.81


def direction(theta, phi):
    """The unit vector of spherical angles, in CasADi's operations."""
    return ca.vertcat(ca.sin(theta) * ca.cos(phi), ca.sin(theta) * ca.sin(phi), ca.cos(theta))


def spherical_axes(theta: np.ndarray, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """e_r, e_θ, e_φ, each (..., 3)."""
    e_r = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    e_theta = np.stack([np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), -np.sin(theta)], axis=-1)
    return e_r, e_theta, np.stack([-np.sin(phi), np.cos(phi), np.zeros_like(phi)], axis=-1)


def rod(length):
    """Two particles a distance length(t) apart: r₁ = q[:3], r₂ = r₁ + d e_r(q[3], q[4])."""
    return lambda t, q: [q[:3], q[:3] + length(t) * direction(q[3], q[4])]


def test_b1_generalised_forces_do_the_virtual_work() -> None:
    """Q = (F₁ + F₂, d F₂·e_θ, d sin θ F₂·e_φ) of two particles on a rod; Σ F·δr = Q·δq by central differences.

    1e-14 for the closed form; h = 1e-5 allows h² + ε/h, 1e-9, for the work.
    """
    rng = np.random.default_rng(1)
    d, h = 0.7, 1e-5
    force = generalized_force(rod(lambda t: d), 5)
    for q, F, dq in zip(
        rng.uniform(-3, 3, (30, 5)), rng.normal(size=(30, 2, 3)), rng.normal(size=(30, 5)), strict=True
    ):
        _, e_theta, e_phi = spherical_axes(*q[3:])
        Q = force(0.0, q, F)
        expected = [*(F[0] + F[1]), d * F[1] @ e_theta, d * np.sin(q[3]) * F[1] @ e_phi]
        np.testing.assert_allclose(Q, expected, rtol=0, atol=1e-14 * np.abs(F).sum())
        dr = (force.positions(0.0, q + h * dq) - force.positions(0.0, q - h * dq)) / (2 * h)
        np.testing.assert_allclose(Q @ dq, (F * dr).sum(), rtol=0, atol=1e-9 * np.abs(F).sum())


@pytest.mark.parametrize("swing", [0.0, 0.4], ids=["fixed", "moving"])
def test_b2_two_particles_on_a_rod_move_as_newton_and_the_rods_force_say(swing: float) -> None:
    """N m_i r̈_i = F_i ± μ r₁₂ with μ from the second derivative of |r₁ − r₂|² = d(t)²; 5 = 6 − 1 coordinates.

    sin θ ≥ 0.3 keeps the condition of M below 400: 1e-12 of the largest acceleration.
    """
    rng = np.random.default_rng(2)
    (m1, m2), d0, rate = (1.3, 0.6), 0.8, 2.1
    g = np.array([0.3, -0.2, -GRAVITY])
    positions = rod(lambda t: d0 + swing * ca.sin(rate * t))
    system = lagrangian_of_particles([m1, m2], positions, 5, gravity=g)
    t, q, v, F = rng.uniform(0, 3, COUNT), rng.uniform(-3, 3, (COUNT, 5)), *rng.normal(size=(2, COUNT, 6))
    q[:, 3], v = rng.uniform(0.3, np.pi - 0.3, COUNT), v[:, :5]
    force = generalized_force(positions, 5)
    Q = np.stack([force(*each) for each in zip(t, q, F.reshape(COUNT, 2, 3), strict=True)])
    a = system.forward_dynamics(q, v, Q, t=t)

    # Newton: w = r₂ − r₁ = d e_r
    d, d1, d2 = (
        x[:, None]
        for x in (d0 + swing * np.sin(rate * t), swing * rate * np.cos(rate * t), -swing * rate**2 * np.sin(rate * t))
    )
    theta, (v_theta, v_phi) = q[:, 3, None], v[:, 3:].T[..., None]
    e_r, e_theta, e_phi = spherical_axes(*q[:, 3:].T)
    u1 = v_theta * e_theta + np.sin(theta) * v_phi * e_phi  # ė_r
    w, w1 = d * e_r, d1 * e_r + d * u1
    f1, f2 = F[:, :3] / m1 + g, F[:, 3:] / m2 + g
    # ½ d²/dt² (w·w) = |ẇ|² + w·ẅ = ḋ² + d d̈, and ẅ = f₂ − f₁ − μ (1/m₁ + 1/m₂) w
    mu = ((w * (f2 - f1)).sum(-1, keepdims=True) + (w1 * w1).sum(-1, keepdims=True) - d1**2 - d * d2) / (
        d**2 * (1 / m1 + 1 / m2)
    )
    r1 = f1 + mu * w / m1
    r2 = f2 - mu * w / m2

    a_theta, a_phi = a[:, 3:].T[..., None]
    u2 = (
        (a_theta - np.sin(theta) * np.cos(theta) * v_phi**2) * e_theta
        + (np.sin(theta) * a_phi + 2 * np.cos(theta) * v_theta * v_phi) * e_phi
        - (v_theta**2 + np.sin(theta) ** 2 * v_phi**2) * e_r
    )
    scale = np.abs(np.concatenate([r1, r2])).max()
    np.testing.assert_allclose(a[:, :3], r1, rtol=0, atol=1e-12 * scale)
    np.testing.assert_allclose(a[:, :3] + d2 * e_r + 2 * d1 * u1 + d * u2, r2, rtol=0, atol=1e-12 * scale)
    if swing:
        with pytest.raises(RobotDynError, match="K depends on t"):
            system.C(q, v, t=t)
    else:
        total = np.matvec(system.M(q, v, t=t), a) + np.matvec(system.C(q, v, t=t), v) + system.N(q, t=t)
        np.testing.assert_allclose(total, Q, rtol=0, atol=1e-12 * scale)


def test_b2_bead_on_a_turning_hoop_keeps_jacobis_integral() -> None:
    """A moving constraint with a closed form: θ̈ = sin θ (Ω² cos θ − g/r), θ from the bottom.

    h = ½ m r² θ̇² − ½ m r² Ω² sin² θ − m g r cos θ; no C, for K is not ½ vᵀ M v.
    Some ten roundings: 1e-13 of Ω², 1e-14 of the energies.
    """
    m, r, Omega = 0.4, 0.5, 6.0
    hoop = lagrangian_of_particles(
        [m], lambda t, q: [r * direction(ca.pi - q[0], Omega * t)], 1, gravity=(0, 0, -GRAVITY)
    )
    t, q, v = np.random.default_rng(3).uniform(-3, 3, (3, COUNT))
    a = hoop.forward_dynamics(q[:, None], v[:, None], np.zeros(1), t=t)[:, 0]
    np.testing.assert_allclose(a, np.sin(q) * (Omega**2 * np.cos(q) - GRAVITY / r), rtol=0, atol=1e-13 * Omega**2)
    h = m * r**2 * (v**2 - Omega**2 * np.sin(q) ** 2) / 2 - m * GRAVITY * r * np.cos(q)
    np.testing.assert_allclose(hoop.jacobi_integral(q[:, None], v[:, None], t=t), h, rtol=0, atol=1e-14 * m * r * 40)
    kept = v * (m * r**2 * a - m * r**2 * Omega**2 * np.sin(q) * np.cos(q) + m * GRAVITY * r * np.sin(q))  # ḣ
    np.testing.assert_allclose(kept, 0, atol=1e-13)


def test_b3_lagrange_equations_from_newtons() -> None:
    """∂T/∂ẋ = m ẋ and m ẍ = Q in one dimension; in spherical coordinates m a = F by its three components.

    a = (r̈ − r θ̇² − r sin²θ φ̇², r θ̈ + 2 ṙ θ̇ − r sinθ cosθ φ̇², r sinθ φ̈ + 2 ṙ sinθ φ̇ + 2 r cosθ θ̇ φ̇); 1e-12 of F.
    """
    rng = np.random.default_rng(3)
    m = 1.7
    line = euler_lagrange(lambda t, q, v: m * v[0] ** 2 / 2, None, 1)
    x, v, Q = rng.normal(size=(3, COUNT, 1))
    np.testing.assert_allclose(line.momentum(x, v), m * v, rtol=1e-15)
    np.testing.assert_allclose(line.forward_dynamics(x, v, Q), Q / m, rtol=1e-15)

    def positions(t, q):
        return [q[0] * direction(q[1], q[2])]

    system, force = lagrangian_of_particles([m], positions, 3), generalized_force(positions, 3)
    q, v, F = rng.uniform(0.4, 2.7, (COUNT, 3)), rng.normal(size=(COUNT, 3)), rng.normal(size=(COUNT, 3))
    Q = np.stack([force(0.0, *each) for each in zip(q, F[:, None], strict=True)])
    (r, theta, phi), (dr, dth, dph) = q.T, v.T
    ddr, ddth, ddph = system.forward_dynamics(q, v, Q).T
    s, c = np.sin(theta), np.cos(theta)
    newton = m * np.stack(
        [
            ddr - r * dth**2 - r * s**2 * dph**2,
            r * ddth + 2 * dr * dth - r * s * c * dph**2,
            r * s * ddph + 2 * dr * s * dph + 2 * r * c * dth * dph,
        ]
    )
    components = np.stack([(F * e).sum(-1) for e in spherical_axes(theta, phi)])
    np.testing.assert_allclose(newton, components, rtol=0, atol=1e-12 * np.abs(newton).max())


@pytest.mark.parametrize("seed", range(10))
def test_b4_mass_and_centre_of_mass_of_an_exponential_density(seed: int) -> None:
    """Integrals ∫ρ dV and ∫ρ p dV of ρ = ρ₀ exp(k·x) over a box, by parts; 24 nodes resolve exp to rounding, 1e-13."""
    rng = np.random.default_rng(seed)
    rho, k, lower = rng.uniform(100, 9000), rng.choice([-1, 1], 3) * rng.uniform(0.5, 2, 3), rng.uniform(-1, 0, 3)
    upper = lower + rng.uniform(0.5, 1.5, 3)
    body = from_density(lambda x: rho * np.exp(x @ k), lower, upper)
    E0 = (np.exp(k * upper) - np.exp(k * lower)) / k
    E1 = ((upper - 1 / k) * np.exp(k * upper) - (lower - 1 / k) * np.exp(k * lower)) / k
    np.testing.assert_allclose(body.mass, rho * E0.prod(), rtol=1e-13)
    np.testing.assert_allclose(body.com, E1 / E0, rtol=0, atol=1e-13)


def planar_2r(m, r, l1: float, inertia) -> EulerLagrange:
    """The deck's 2R arm from K and V: x₁ = r₁c₁, x₂ = l₁c₁ + r₂c₁₂, and likewise y."""

    def centres(q):
        return [
            ca.vertcat(r[0] * ca.cos(q[0]), r[0] * ca.sin(q[0])),
            ca.vertcat(l1 * ca.cos(q[0]) + r[1] * ca.cos(q[0] + q[1]), l1 * ca.sin(q[0]) + r[1] * ca.sin(q[0] + q[1])),
        ]

    def kinetic(t, q, v):
        speeds = [ca.jtimes(p, q, v) for p in centres(q)]
        omegas = [v[0], v[0] + v[1]]
        return sum(m[i] * ca.sumsqr(speeds[i]) + inertia[i] * omegas[i] ** 2 for i in range(2)) / 2

    def potential(t, q):
        return GRAVITY * sum(mass * p[1] for mass, p in zip(m, centres(q), strict=True))

    return euler_lagrange(kinetic, potential, 2)


def closed_form(m, r, l1: float, inertia, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M, C and N of the deck's 2R arm, which are Spong's, at one state or a batch."""
    (m1, m2), (r1, r2), (I1, I2) = m, r, inertia
    (q1, q2), (v1, v2) = q.T, v.T
    M12 = m2 * (r2**2 + l1 * r2 * np.cos(q2)) + I2
    M11 = m1 * r1**2 + I1 + m2 * (l1**2 + r2**2 + 2 * l1 * r2 * np.cos(q2)) + I2
    h = -m2 * l1 * r2 * np.sin(q2)
    N2 = GRAVITY * m2 * r2 * np.cos(q1 + q2)
    M = np.array([[M11, M12], [M12, m2 * r2**2 + I2 + 0 * h]])
    C = np.array([[h * v2, h * (v1 + v2)], [-h * v1, 0 * h]])
    N = np.array([GRAVITY * (m1 * r1 + m2 * l1) * np.cos(q1) + N2, N2])
    return M.T, np.moveaxis(C, (0, 1), (-2, -1)), N.T


def uniform_bars(rng: np.random.Generator | None) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
    """m, r, l₁, I_zz of two bars with their centres half-way; those of urdf/planar_2r without a generator."""
    m, length = (np.array([2.0, 1.5]), np.array([1.0, 0.8])) if rng is None else rng.uniform(0.3, 3, (2, 2))
    inertia = np.array([box(*bar, 0.05, 0.05).inertia[2, 2] for bar in zip(m, length, strict=True)])
    return m, length / 2, length[0], inertia


def test_b5_planar_2r_arm_from_its_energies_is_the_closed_form_and_the_urdf() -> None:
    """M, C, N of equations.md at random bars and of urdf/planar_2r by both implementations; sign of ẋ₂; 1e-13."""
    rng = np.random.default_rng(5)
    q, v = rng.uniform(-3, 3, (2, COUNT, 2))
    robot = rd.load("planar_2r").with_(gravity=(0.0, 0.0, -GRAVITY))
    for bars in (uniform_bars(rng), uniform_bars(rng), uniform_bars(None)):
        M, C, N = closed_form(*bars, q, v)
        arm = planar_2r(*bars)
        scale = 1e-13 * M.max()
        np.testing.assert_allclose(arm.M(q, v), M, rtol=0, atol=scale)
        np.testing.assert_allclose(arm.C(q, v), C, rtol=0, atol=6 * scale)
        np.testing.assert_allclose(arm.N(q), N, rtol=0, atol=1e-13 * np.abs(N).max())
    for engine in (robot, rd.Lagrangian(robot)):  # the last bars are those of the file
        np.testing.assert_allclose(engine.M(q), arm.M(q, v), rtol=0, atol=scale)
        np.testing.assert_allclose(engine.C(q, v), arm.C(q, v), rtol=0, atol=6 * scale)
        np.testing.assert_allclose(engine.N(q), arm.N(q), rtol=0, atol=1e-13 * np.abs(N).max())

    _, (_, r2), l1, _ = bars
    centre = generalized_force(
        lambda t, q: [
            [l1 * ca.cos(q[0]) + r2 * ca.cos(q[0] + q[1]), l1 * ca.sin(q[0]) + r2 * ca.sin(q[0] + q[1]), 0],
        ],
        2,
    )
    s1, s12 = np.sin(q[0, 0]), np.sin(q[0].sum())
    np.testing.assert_allclose(centre.jacobian(0.0, q[0])[0, 0], [-(l1 * s1 + r2 * s12), -r2 * s12], rtol=1e-14)


def test_b6_inertia_coriolis_vector_and_gravity_make_up_the_torque() -> None:
    """B a + C(q, v) + G = τ with the vector C = C(q, v) v, the part of the torque that is quadratic in v; B > 0.

    The loaded robot offers the vector as `coriolis_torque`. 1e-13 of the largest torque.
    """
    rng = np.random.default_rng(6)
    q, v, a = rng.uniform(-3, 3, (3, COUNT, 2))
    arm, robot = planar_2r(*uniform_bars(None)), rd.load("planar_2r").with_(gravity=(0.0, 0.0, -GRAVITY))
    tau, rest = arm.inverse_dynamics(q, v, a), 0 * v
    B = arm.M(q, v)
    vector, G = np.matvec(arm.C(q, v), v), arm.inverse_dynamics(q, rest, rest)
    scale = 1e-13 * np.abs(tau).max()
    np.testing.assert_allclose(np.matvec(B, a) + vector + G, tau, rtol=0, atol=scale)
    np.testing.assert_allclose(arm.bias(q, 3 * v) - G, 9 * vector, rtol=0, atol=10 * scale)
    np.testing.assert_allclose(robot.coriolis_torque(q, v), vector, rtol=0, atol=scale)
    np.testing.assert_allclose(robot.inverse_dynamics(q, v, a), tau, rtol=0, atol=scale)
    assert np.linalg.eigvalsh(B).min() > 0
    np.testing.assert_array_equal(B, np.swapaxes(B, -1, -2))


ENGINES = (lambda robot: robot, rd.Lagrangian)
POSITIVE = st.floats(0.1, 5.0)
ANGLE, RATE = st.floats(-3.0, 3.0), st.floats(-4.0, 4.0)


@settings(max_examples=100)
@given(
    st.lists(POSITIVE, min_size=2, max_size=2),
    st.lists(st.floats(0.05, 2.0), min_size=2, max_size=2),
    st.floats(0.1, 2.0),
    st.lists(st.floats(0.01, 1.0), min_size=2, max_size=2),
    st.tuples(ANGLE, ANGLE),
    st.tuples(RATE, RATE),
)
def test_planar_2r_arm_has_its_closed_form(m, r, l1, I, q, v) -> None:  # noqa: E741
    """In the plane x–y with gravity along −y; a dozen roundings of the largest terms, so 1e-14 of them."""
    M, C, N = closed_form(m, r, l1, I, np.array(q), np.array(v))
    terms, force = m[0] * r[0] ** 2 + I[0] + m[1] * (l1 + r[1]) ** 2 + I[1], m[0] * r[0] + m[1] * (l1 + r[1])
    bars = [body(mass, f"{com!r} 0 0", moment) for mass, com, moment in zip(m, r, I, strict=True)]
    text = chain(*bars, at=("0 0 0", f"{l1!r} 0 0"))
    robot = rd.Robot(check(text.encode(), "2r")).with_(gravity=(0.0, -GRAVITY, 0.0))
    for engine in ENGINES:
        dynamics = engine(robot)
        np.testing.assert_allclose(dynamics.M(q), M, rtol=0, atol=1e-14 * terms)
        np.testing.assert_allclose(dynamics.C(q, v), C, rtol=0, atol=1e-14 * terms * (1 + np.abs(v).sum()))
        np.testing.assert_allclose(dynamics.N(q), N, rtol=0, atol=1e-14 * GRAVITY * force)


@pytest.mark.parametrize("engine", ENGINES)
def test_pendulum_has_its_closed_form(engine) -> None:
    """Uniform rod about its end: M = m l²/3, V = −m g (l/2) cos q, N = ∂V/∂q; the file prints 18 digits."""
    dynamics, q, g = engine(rd.load("pendulum")), [0.7], rd.STANDARD_GRAVITY[2]
    np.testing.assert_allclose(dynamics.M(q), [[1 / 3]], rtol=1e-15)
    np.testing.assert_allclose(dynamics.N(q), [-g * 0.5 * np.sin(0.7)], rtol=1e-15)
    np.testing.assert_allclose(dynamics.C(q, [2.0]), [[0.0]], atol=1e-16)
    np.testing.assert_allclose(dynamics.potential_energy(q), g * 0.5 * np.cos(0.7), rtol=1e-15)


@pytest.mark.parametrize("engine", ENGINES)
def test_cart_pole_has_its_closed_form(engine) -> None:
    """M = [[m_c + m_p, m_p l cos q], [·, I + m_p l²]], C v = (−m_p l sin q v², 0), N = (0, −m_p g l sin q)."""
    dynamics, (x, q), (xdot, v) = engine(rd.load("cart_pole")), (0.3, 0.8), (0.5, -1.1)
    mc, mp, length, inertia, g = 5.0, 1.2, 0.6, 0.144, -rd.STANDARD_GRAVITY[2]
    M12 = mp * length * np.cos(q)
    np.testing.assert_allclose(dynamics.M([x, q]), [[mc + mp, M12], [M12, inertia + mp * length**2]], rtol=1e-15)
    np.testing.assert_allclose(
        dynamics.coriolis_torque([x, q], [xdot, v]), [-mp * length * np.sin(q) * v**2, 0.0], rtol=1e-15, atol=1e-16
    )
    np.testing.assert_allclose(dynamics.N([x, q]), [0.0, -mp * g * length * np.sin(q)], rtol=1e-15, atol=1e-15)
