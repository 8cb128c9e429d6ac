"""The systems of deck 000, one test a row of the equations: A1–A6, the rigid body, and A7–A12, its motion."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robot_dyn import RobotDynError, euler_lagrange
from robot_dyn.description import MassProperties, box, combined, cylinder, ellipsoid, from_density, sphere
from robot_dyn.foundations import adjoint, adjoint_inverse, bracket, hat, homogeneous, rotation, rotation_rpy
from robot_dyn.lagrange import (
    EulerLagrange,
    angular_momentum,
    body_acceleration,
    body_wrench,
    point_velocity,
    world_acceleration,
    world_wrench,
)
from robot_dyn.lagrange.rigid_body import kinetic_energy

SEEDS = range(20)
BODY = box(1.7, 0.3, 0.5, 0.8).moved(rotation_rpy(np.array([0.4, -0.9, 1.3])), np.zeros(3))  # full inertia, com at 0


def placement(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A general rigid motion (R, p)."""
    return rotation_rpy(rng.uniform(-3, 3, 3)), rng.uniform(-1, 1, 3)


@pytest.mark.parametrize("seed", SEEDS)
def test_a1_velocities_of_a_rigid_motion(seed: int) -> None:
    """â b = a × b, V̂ᵇ = g⁻¹ġ, V̂ˢ = ġg⁻¹ for g = exp(â₁ α t) exp(â₂ β t), p cubic.

    ġ by the complex step, whose error is rounding, so 1e-13; ω by adding the two turns' rates.
    """
    rng = np.random.default_rng(seed)
    a1, a2, alpha, beta, p = *rng.normal(size=(2, 3)), *rng.uniform(-2, 2, 2), rng.normal(size=(4, 3))
    a1, a2 = a1 / np.linalg.norm(a1), a2 / np.linalg.norm(a2)
    np.testing.assert_allclose(hat(a1) @ a2, np.cross(a1, a2), rtol=0, atol=1e-15)

    def motion(t: complex) -> tuple[Any, Any]:
        return rotation(a1, alpha * t) @ rotation(a2, beta * t), p[0] + p[1] * t + p[2] * t**2 + p[3] * t**3

    h, t = 1e-30, 0.8
    R, position = (x.real for x in motion(t))
    g, g_dot = homogeneous(R, position), homogeneous(*(x.imag / h for x in motion(t + 1j * h)))
    g_dot[3, 3] = 0.0  # `homogeneous` sets the corner of g, which does not move
    omega = alpha * a1 + R @ (beta * a2)
    body = np.concatenate([R.T @ g_dot[:3, 3], R.T @ omega])
    spatial = np.concatenate([g_dot[:3, 3] - np.cross(omega, position), omega])
    for matrix, V in ((np.linalg.inv(g) @ g_dot, body), (g_dot @ np.linalg.inv(g), spatial)):
        np.testing.assert_allclose(matrix[:3, :3], hat(V[3:]), rtol=0, atol=1e-13)
        np.testing.assert_allclose(matrix[:, 3], [*V[:3], 0.0], rtol=0, atol=1e-13)
    np.testing.assert_allclose(adjoint(R, position) @ body, spatial, rtol=0, atol=1e-13)


@pytest.mark.parametrize("seed", SEEDS[:3])
def test_a2_power_and_work_are_the_same_in_every_frame(seed: int) -> None:
    """V_b = Ad V_c and F_c = Adᵀ F_b along a motion: the works ∫ V·F dt agree, and are the energy gained.

    DOP853 at rtol 1e-12 over 2 s: 1e-10 of the work.
    """
    rng = np.random.default_rng(seed)
    g, F_b, start = placement(rng), rng.normal(size=6), rng.normal(size=6)
    F_c = adjoint(*g).T @ F_b

    def rates(_: float, state: np.ndarray) -> np.ndarray:
        V_b = state[:6]
        V_c = adjoint_inverse(*g) @ V_b
        return np.concatenate([body_acceleration(BODY, V_b, F_b), [V_b @ F_b, V_c @ F_c]])

    run = solve_ivp(rates, (0, 2), [*start, 0, 0], method="DOP853", rtol=1e-12, atol=1e-12)
    end, W_b, W_c = run.y[:6, -1], *run.y[6:, -1]
    gained = kinetic_energy(BODY, end) - kinetic_energy(BODY, start)
    assert abs(gained) > 0.1
    np.testing.assert_allclose([W_b, W_c], gained, rtol=1e-10)


@pytest.mark.parametrize("seed", SEEDS)
def test_a3_kinetic_energy_is_the_sum_over_the_points(seed: int) -> None:
    """Σ ½ m ‖ṙ‖² of 30 points = ½ m ‖ṗ_c‖² + ½ ωᵀ I ω at the centre of mass; elsewhere m ṗ·(ω × c) joins; 1e-12."""
    rng = np.random.default_rng(seed)
    masses, points, twist = rng.uniform(0.1, 1, 30), rng.normal(size=(30, 3)), rng.normal(size=6)
    body = combined(MassProperties(m, x, np.zeros((3, 3))) for m, x in zip(masses, points, strict=True))
    velocities = twist[:3] + np.cross(twist[3:], points)  # the frame's origin is a point of the body
    K = (masses * (velocities**2).sum(-1)).sum() / 2

    at_com = np.concatenate([point_velocity(twist, body.com), twist[3:]])
    np.testing.assert_allclose(kinetic_energy(body, at_com), K, rtol=1e-12)
    np.testing.assert_allclose(point_velocity(at_com, points - body.com), velocities, rtol=0, atol=1e-13)
    cross = body.mass * twist[:3] @ np.cross(twist[3:], body.com)
    about_origin = (body.mass * twist[:3] @ twist[:3] + twist[3:] @ body.about(np.zeros(3)) @ twist[3:]) / 2
    np.testing.assert_allclose(about_origin + cross, K, rtol=1e-12)
    np.testing.assert_allclose(twist @ body.spatial @ twist / 2, K, rtol=1e-12)
    assert abs(cross) > 1e-6 * K


@pytest.mark.parametrize("seed", SEEDS)
def test_a4_rotational_inertia_of_a_polynomial_density(seed: int) -> None:
    """I = ∫ ρ r̂ᵀ r̂ dx of ρ = Σ a_ijk xⁱ yʲ zᵏ over a box, each integral from (u^{i+1} − l^{i+1})/(i+1).

    The quadrature is exact for polynomials: 1e-13; moving the expected moments to the centre of mass cancels a
    digit, so 1e-12 for the inertia.
    """
    rng = np.random.default_rng(seed)
    a, lower = rng.uniform(0, 900, (3, 3, 3)), rng.uniform(0, 0.5, 3)
    upper = lower + rng.uniform(0.2, 1, 3)

    def integral(px: int, py: int, pz: int) -> float:
        sides = [
            np.array([(u ** (i + p + 1) - low ** (i + p + 1)) / (i + p + 1) for i in range(3)])
            for low, u, p in zip(lower, upper, (px, py, pz), strict=True)
        ]
        return float(np.einsum("ijk,i,j,k->", a, *sides))

    unit = np.eye(3, dtype=int)
    m = integral(0, 0, 0)
    com = np.array([integral(*e) for e in unit]) / m
    second = np.array([[integral(*(e + f)) for f in unit] for e in unit]) - m * np.outer(com, com)
    body = from_density(lambda x: np.polynomial.polynomial.polyval3d(x[:, 0], x[:, 1], x[:, 2], a), lower, upper)
    np.testing.assert_allclose(body.mass, m, rtol=1e-13)
    np.testing.assert_allclose(body.com, com, rtol=1e-13)
    inertia = np.trace(second) * np.eye(3) - second  # r̂ᵀ r̂ = |r|² 1 − r rᵀ
    np.testing.assert_allclose(body.inertia, inertia, rtol=0, atol=1e-12 * np.trace(inertia))
    assert np.abs(inertia[np.triu_indices(3, 1)]).min() > 1e-6 * np.trace(inertia)


def in_cylinder(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    r, phi, z = np.moveaxis(u, -1, 0)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1), r


@pytest.mark.parametrize("seed", SEEDS[:5])
def test_a5_solids_have_the_inertia_and_volume_of_the_table(seed: int) -> None:
    """The table's moments and volumes, and the solids' functions, against A4's integral of a uniform density.

    The angle's trigonometric polynomials need about 20 nodes for rounding; 24 are used, so 1e-13.
    """
    rng = np.random.default_rng(seed)
    rho, (a, b, c) = rng.uniform(100, 9000), rng.uniform(0.1, 2, 3)

    def in_ellipsoid(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        s, theta, phi = np.moveaxis(u, -1, 0)
        ring = s * np.sin(theta)
        x = np.stack([a * ring * np.cos(phi), b * ring * np.sin(phi), c * s * np.cos(theta)], axis=-1)
        return x, a * b * c * s * ring

    half = np.array([a, b, c]) / 2
    turn = 2 * np.pi
    round_parts = {
        "cylinder": (in_cylinder, [0, 0, -b / 2], [a, turn, b / 2]),
        "ellipsoid": (in_ellipsoid, [0, 0, 0], [1, np.pi, turn]),
    }
    integrals = {name: from_density(lambda x: rho, lo, up, chart=f) for name, (f, lo, up) in round_parts.items()}
    squares = np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2])
    of_disc = np.array([(3 * a**2 + b**2) / 12] * 2 + [a**2 / 2])
    table = [  # solid, its integral, volume, moments per mass
        (box, (a, b, c), from_density(lambda x: rho, -half, half), a * b * c, squares / 12),
        (cylinder, (a, b), integrals["cylinder"], np.pi * a**2 * b, of_disc),
        (ellipsoid, (a, b, c), integrals["ellipsoid"], 4 * np.pi * a * b * c / 3, squares / 5),
    ]
    for solid, lengths, integral, volume, moments in table:
        body = solid(integral.mass, *lengths)
        np.testing.assert_allclose(integral.mass, rho * volume, rtol=1e-13)
        np.testing.assert_allclose(body.inertia, np.diag(body.mass * moments), rtol=1e-15)
        np.testing.assert_allclose(integral.inertia, body.inertia, rtol=0, atol=1e-13 * np.trace(body.inertia))
        np.testing.assert_allclose(integral.com, 0, atol=1e-14)
    np.testing.assert_allclose(sphere(rho, a).inertia, 0.4 * rho * a**2 * np.eye(3), rtol=1e-15)


@pytest.mark.parametrize("seed", SEEDS)
def test_a6_generalised_inertia_changes_frame(seed: int) -> None:
    """𝓜 = diag(m 1, I) at the centre of mass, 𝓜_c = Adᵀ 𝓜_b Ad, and its energy is that of frame B; 1e-13."""
    rng = np.random.default_rng(seed)
    (R, p), V_c = placement(rng), rng.normal(size=6)
    Ad = adjoint(R, p)
    np.testing.assert_array_equal(BODY.spatial[:3, :3], BODY.mass * np.eye(3))
    np.testing.assert_array_equal(BODY.spatial[3:, 3:], BODY.inertia)
    assert not BODY.spatial[:3, 3:].any()
    in_c = BODY.moved(R.T, -R.T @ p)  # frame B seen from C is g⁻¹
    np.testing.assert_allclose(in_c.spatial, Ad.T @ BODY.spatial @ Ad, rtol=0, atol=1e-13)
    np.testing.assert_allclose(V_c @ in_c.spatial @ V_c / 2, kinetic_energy(BODY, Ad @ V_c), rtol=1e-13)
    two = combined([in_c, sphere(0.9, 0.2).moved(np.eye(3), p)])
    parts = in_c.spatial + sphere(0.9, 0.2).moved(np.eye(3), p).spatial
    np.testing.assert_allclose(two.spatial, parts, rtol=0, atol=1e-13)


COUNT = 200  # states of a test, as one batch
X, Y, Z = np.eye(3)


def test_a7_lagrange_equations_of_any_energies_in_any_coordinates() -> None:
    """A relativistic particle has d(γ m v)/dt = F, and coordinates q = f(s) change nothing: a_q = J a_s + J̇ ṡ; 1e-11.

    Conditions of M and of J up to 100 leave 1e-11 of the largest acceleration.
    """
    rng = np.random.default_rng(7)
    m, c, k = 1.3, 2.5, 4.0
    v, F, q = rng.uniform(-1, 1, (COUNT, 3)), rng.normal(size=(COUNT, 3)), rng.normal(size=(COUNT, 3))
    particle = euler_lagrange(
        lambda t, q, v: -m * c**2 * ca.sqrt(1 - ca.sumsqr(v) / c**2), lambda t, q: k * ca.sumsqr(q) / 2, 3
    )
    gamma, force = 1 / np.sqrt(1 - (v * v).sum(-1, keepdims=True) / c**2), F - k * q
    expected = (force - (force * v).sum(-1, keepdims=True) * v / c**2) / (gamma * m)
    np.testing.assert_allclose(particle.forward_dynamics(q, v, F), expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(particle.momentum(q, v), gamma * m * v, rtol=1e-13)
    with pytest.raises(RobotDynError, match="not quadratic in v"):
        particle.C(q, v)

    filling = euler_lagrange(lambda t, q, v: (1 + t**2) * v[0] ** 2 / 2, None, 1)  # d((1 + t²) v)/dt = F
    t = rng.normal(size=(COUNT, 1))
    by_momentum = (F[:, :1] - 2 * t * v[:, :1]) / (1 + t**2)
    np.testing.assert_allclose(
        filling.forward_dynamics(q[:, :1], v[:, :1], F[:, :1], t=t[:, 0]), by_momentum, atol=1e-14
    )

    def kinetic(t, q, v):
        return (2 + ca.cos(q[1])) * v[0] ** 2 + v[0] * v[1] * ca.sin(q[0] + t) + v[1] ** 2 + v[0] ** 4 + t * v[1] * q[0]

    def potential(t, q):
        return ca.exp(q[0]) * q[1] ** 2 + ca.sin(t) * q[1]

    def f(s):
        return ca.vertcat(s[0] + ca.sin(s[1]) / 2, s[1] + s[0] ** 2 / 4)

    def kinetic_in_s(t, s, w):
        return kinetic(t, f(s), ca.jtimes(f(s), s, w))

    of_q = euler_lagrange(kinetic, potential, 2)
    of_s = euler_lagrange(kinetic_in_s, lambda t, s: potential(t, f(s)), 2)
    t, (s, w, Q) = rng.normal(size=COUNT), rng.uniform(-1, 1, (3, COUNT, 2))
    one, c1 = np.ones(COUNT), np.cos(s[:, 1])
    J = np.stack([np.stack([one, c1 / 2], -1), np.stack([s[:, 0] / 2, one], -1)], axis=-2)
    J_dot_w = np.stack([-np.sin(s[:, 1]) * w[:, 1] ** 2 / 2, w[:, 0] ** 2 / 2], axis=-1)
    at_q = np.stack([s[:, 0] + np.sin(s[:, 1]) / 2, s[:, 1] + s[:, 0] ** 2 / 4], axis=-1)
    a_q = of_q.forward_dynamics(at_q, np.matvec(J, w), Q, t=t)
    a_s = of_s.forward_dynamics(s, w, np.vecmat(Q, J), t=t)  # Q_s = Jᵀ Q_q
    np.testing.assert_allclose(np.matvec(J, a_s) + J_dot_w, a_q, rtol=0, atol=1e-11 * np.abs(a_q).max())


def test_a8_falling_ball() -> None:
    """K = ½ m v², V = m g h ⇒ F = m a + m g: two products and a sum, 1e-15."""
    rng = np.random.default_rng(8)
    for m, g in rng.uniform(0.1, 20, (10, 2)):
        ball = euler_lagrange(lambda t, q, v, m=m: m * v[0] ** 2 / 2, lambda t, q, m=m, g=g: m * g * q[0], 1)
        h, v, a, F = rng.normal(size=(4, COUNT, 1))
        np.testing.assert_allclose(ball.inverse_dynamics(h, v, a), m * a + m * g, rtol=0, atol=1e-15 * m * (g + 5))
        np.testing.assert_allclose(ball.forward_dynamics(h, v, F), F / m - g, rtol=0, atol=1e-15 * (5 / m + g))


def free_body() -> EulerLagrange:
    """BODY in the coordinates (p, roll, pitch, yaw): ω̂ = Rᵀ Ṙ in body axes, straight from R = Rz Ry Rx."""

    def turn(i: int, angle):
        j, k = (i + 1) % 3, (i + 2) % 3
        R = ca.SX.eye(3)
        R[j, j] = R[k, k] = ca.cos(angle)
        R[k, j], R[j, k] = ca.sin(angle), -ca.sin(angle)
        return R

    def kinetic(t, q, v):
        R = turn(2, q[5]) @ turn(1, q[4]) @ turn(0, q[3])
        S = R.T @ ca.jtimes(R, q, v)
        omega = ca.vertcat(S[2, 1], S[0, 2], S[1, 0])
        return (BODY.mass * ca.sumsqr(v[:3]) + omega.T @ ca.DM(BODY.inertia) @ omega) / 2

    return euler_lagrange(kinetic, None, 6)


def test_a9_newton_euler_in_world_axes_follows_from_lagrange_in_euler_angles() -> None:
    """Lagrange in (p, roll, pitch, yaw) gives (p̈, ω̇) of m p̈ = f, I_s ω̇ + ω × I_s ω = τ.

    ω = E q̇ with columns x', y', z of the turning axes, Q = (f, Eᵀ τ) by virtual work, ω̇ = E q̈ + Ė q̇. Pitch stays
    0.3 rad off gimbal lock, where M has a condition of 1e3: 1e-11 of the largest acceleration.
    """
    rng = np.random.default_rng(9)
    q, v, wrench = rng.uniform(-3, 3, (COUNT, 6)), rng.normal(size=(COUNT, 6)), rng.normal(size=(COUNT, 6))
    q[:, 4] = rng.uniform(-1.27, 1.27, COUNT)
    yaw, pitch = rotation(Z, q[:, 5]), rotation(Y, q[:, 4])
    R = yaw @ pitch @ rotation(X, q[:, 3])
    x, y = yaw @ pitch @ X, yaw @ Y
    E = np.stack([x, y, np.broadcast_to(Z, x.shape)], axis=-1)
    omega = np.matvec(E, v[:, 3:])
    of_yaw = v[:, 5, None] * Z  # each axis turns with the angles outside of it
    E_dot_v = v[:, 3, None] * np.cross(of_yaw + v[:, 4, None] * y, x) + v[:, 4, None] * np.cross(of_yaw, y)

    Q = np.concatenate([wrench[:, :3], np.vecmat(wrench[:, 3:], E)], axis=-1)
    a = free_body().forward_dynamics(q, v, Q)
    derived = np.concatenate([a[:, :3], np.matvec(E, a[:, 3:]) + E_dot_v], axis=-1)
    newton_euler = world_acceleration(BODY, R, omega, wrench)
    np.testing.assert_allclose(newton_euler, derived, rtol=0, atol=1e-11 * np.abs(derived).max())
    np.testing.assert_allclose(
        world_wrench(BODY, R, omega, derived), wrench, rtol=0, atol=1e-11 * np.abs(derived).max()
    )
    torque = wrench[:, 3:]
    I_s = R @ BODY.inertia @ np.swapaxes(R, -1, -2)
    law = np.matvec(I_s, derived[:, 3:]) + np.cross(omega, np.matvec(I_s, omega))
    np.testing.assert_allclose(law, torque, rtol=0, atol=1e-11 * np.abs(derived).max())


def test_a10_newton_euler_in_body_axes_is_that_in_world_axes() -> None:
    """With v = Rᵀ ṗ and v̇ = Rᵀ p̈ − ω × v, m v̇ + ω × m v = f and I ω̇ + ω × I ω = τ; as one, F = 𝓜 V̇ − ad_Vᵀ 𝓜 V.

    Moments from 0.05 to 0.13 kg m² amplify rounding to some 1e-14: 1e-12.
    """
    rng = np.random.default_rng(10)
    R = rotation(Z, rng.uniform(-3, 3, COUNT)) @ rotation(X, rng.uniform(-3, 3, COUNT))
    twist, wrench = rng.normal(size=(2, COUNT, 6))
    omega = twist[:, 3:]
    rate = body_acceleration(BODY, twist, wrench)
    turned = np.concatenate([np.matvec(R, wrench[:, :3]), np.matvec(R, wrench[:, 3:])], axis=-1)
    world = world_acceleration(BODY, R, np.matvec(R, omega), turned)
    np.testing.assert_allclose(rate[:, :3] + np.cross(omega, twist[:, :3]), np.vecmat(world[:, :3], R), atol=1e-12)
    np.testing.assert_allclose(rate[:, 3:], np.vecmat(world[:, 3:], R), atol=1e-12)  # ω × ω = 0: no further term
    np.testing.assert_allclose(body_wrench(BODY, twist, rate), wrench, atol=1e-12)
    momentum = np.matvec(BODY.spatial, twist)
    law = np.matvec(BODY.spatial, rate) - np.vecmat(momentum, bracket(twist))
    np.testing.assert_allclose(law, wrench, atol=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_a11_cylinder_rolls_with_two_thirds_of_g_sin_alpha(seed: int) -> None:
    """Down the incline a = ⅔ g sin α, from A7 with ω = ẋ/r and from A9 with the contact's force; 1e-14 of it."""
    m, r, height, alpha, g = np.random.default_rng(seed).uniform((0.2, 0.05, 0.1, 0.1, 1), (9, 0.6, 2, 1.4, 20))
    expected = 2 / 3 * g * np.sin(alpha)
    body = cylinder(m, r, height)
    Izz = body.inertia[2, 2]

    rolling = euler_lagrange(
        lambda t, q, v: m * v[0] ** 2 / 2 + Izz * (v[0] / r) ** 2 / 2, lambda t, q: -m * g * np.sin(alpha) * q[0], 1
    )
    np.testing.assert_allclose(rolling.forward_dynamics([0.4], [-1.2], [0.0]), [expected], rtol=1e-14)

    # Newton–Euler: x down the slope, y off it, z along the axis. Downhill roll is ω_z < 0; contact at −r y.
    weight = m * g * np.array([np.sin(alpha), -np.cos(alpha), 0])
    R, omega = rotation(Z, 0.7), np.array([0, 0, -3.0])

    def torque_left_over(a: float) -> float:
        """Of the motion (a, ω̇ = −a/r), what the contact's force cannot give."""
        wrench = world_wrench(body, R, omega, [a, 0, 0, 0, 0, -a / r])
        return (wrench[3:] - np.cross([0, -r, 0], wrench[:3] - weight))[2]

    at_rest, at_g = torque_left_over(0.0), torque_left_over(g)  # linear in a
    np.testing.assert_allclose(g * at_rest / (at_rest - at_g), expected, rtol=1e-14)

    contact = np.array([-m * g * np.sin(alpha) / 3, m * g * np.cos(alpha), 0])
    motion = world_acceleration(body, R, omega, [*(weight + contact), *np.cross([0, -r, 0], contact)])
    np.testing.assert_allclose(motion, [expected, 0, 0, 0, 0, -expected / r], rtol=1e-13, atol=1e-14 * g / r)


def spin(omega0: np.ndarray, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """ω in body axes, (steps, 3), and R, (steps, 3, 3), of the free body that starts along the world's axes."""

    def rates(_: float, state: np.ndarray) -> np.ndarray:
        omega, R = state[:3], state[3:].reshape(3, 3)
        omega_dot = body_acceleration(SPINNER, [0, 0, 0, *omega], np.zeros(6))[3:]
        return np.concatenate([omega_dot, (R @ hat(omega)).ravel()])

    start = np.concatenate([omega0, np.eye(3).ravel()])
    run = solve_ivp(rates, (0, duration), start, method="DOP853", rtol=1e-12, atol=1e-14)
    return run.y[:3].T, run.y[3:].T.reshape(-1, 3, 3)


SPINNER = box(1.2, 0.3, 0.2, 0.1)  # I₁ < I₂ < I₃ along x, y, z


def test_a12_torque_free_body_keeps_energy_and_momentum_and_flees_its_middle_axis() -> None:
    """K and I_s ω stay to 1e-10 (rtol 1e-12, some 10³ steps); nudged by 1e-3, only the middle axis turns over.

    Along the middle axis the growth is exp(λ t), λ² = Ω² (I₃ − I₂)(I₂ − I₁)/(I₁ I₃), in the linear regime: a nudge of
    1e-6 along the growing direction is still below 1e-4 at the end, so its square is less than 1e-7 of it.
    """
    rate, nudge = 6.0, 1e-3
    for axis in range(3):
        omega, R = spin(rate * np.eye(3)[axis] + nudge * np.ones(3), 6.0)
        K = kinetic_energy(SPINNER, np.concatenate([np.zeros_like(omega), omega], axis=-1))
        L = angular_momentum(SPINNER, R, np.matvec(R, omega))
        np.testing.assert_allclose(K, K[0], rtol=1e-10)
        np.testing.assert_allclose(L, np.broadcast_to(L[0], L.shape), rtol=0, atol=1e-10 * float(np.linalg.norm(L[0])))
        off_axis = np.abs(np.delete(omega, axis, axis=-1)).max()
        if axis == 1:
            assert omega[:, 1].min() < -0.9 * rate  # it turns over
        else:
            assert off_axis < 10 * nudge

    I1, I2, I3 = np.diag(SPINNER.inertia)
    growth = rate * np.sqrt((I3 - I2) * (I2 - I1) / (I1 * I3))
    direction = np.array([np.sqrt((I3 - I2) / I1), 0, -np.sqrt((I2 - I1) / I3)])
    sign = np.sign((I2 - I3) / I1 * rate * direction[2] / direction[0])  # ω̇₁ = (I₂ − I₃)/I₁ Ω ω₃ = λ ω₁
    assert sign > 0
    duration = 4 / growth
    omega, _ = spin(rate * Y + 1e-6 * direction, duration)
    np.testing.assert_allclose(omega[-1, [0, 2]], 1e-6 * np.exp(4) * direction[[0, 2]], rtol=1e-6)
