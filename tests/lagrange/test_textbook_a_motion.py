"""The systems of deck 000, one test a row of the equations: A7–A12, Lagrange and Newton–Euler."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robot_dyn import RobotDynError, euler_lagrange
from robot_dyn.description import box, cylinder
from robot_dyn.foundations import bracket, hat, rotation, rotation_rpy
from robot_dyn.lagrange import (
    EulerLagrange,
    angular_momentum,
    body_acceleration,
    body_wrench,
    world_acceleration,
    world_wrench,
)
from robot_dyn.lagrange.rigid_body import kinetic_energy

COUNT = 200  # states of a test, as one batch
X, Y, Z = np.eye(3)
BODY = box(1.7, 0.3, 0.5, 0.8).moved(rotation_rpy(np.array([0.4, -0.9, 1.3])), np.zeros(3))  # full inertia, com at 0


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
    np.testing.assert_allclose(particle.forward_dynamics(0.0, q, v, F), expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(particle.momentum(0.0, q, v), gamma * m * v, rtol=1e-13)
    with pytest.raises(RobotDynError, match="not quadratic in v"):
        particle.C(0.0, q, v)

    filling = euler_lagrange(lambda t, q, v: (1 + t**2) * v[0] ** 2 / 2, None, 1)  # d((1 + t²) v)/dt = F
    t = rng.normal(size=(COUNT, 1))
    by_momentum = (F[:, :1] - 2 * t * v[:, :1]) / (1 + t**2)
    np.testing.assert_allclose(filling.forward_dynamics(t[:, 0], q[:, :1], v[:, :1], F[:, :1]), by_momentum, atol=1e-14)

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
    a_q = of_q.forward_dynamics(t, at_q, np.matvec(J, w), Q)
    a_s = of_s.forward_dynamics(t, s, w, np.vecmat(Q, J))  # Q_s = Jᵀ Q_q
    np.testing.assert_allclose(np.matvec(J, a_s) + J_dot_w, a_q, rtol=0, atol=1e-11 * np.abs(a_q).max())


def test_a8_falling_ball() -> None:
    """K = ½ m v², V = m g h ⇒ F = m a + m g: two products and a sum, 1e-15."""
    rng = np.random.default_rng(8)
    for m, g in rng.uniform(0.1, 20, (10, 2)):
        ball = euler_lagrange(lambda t, q, v, m=m: m * v[0] ** 2 / 2, lambda t, q, m=m, g=g: m * g * q[0], 1)
        h, v, a, F = rng.normal(size=(4, COUNT, 1))
        np.testing.assert_allclose(ball.inverse_dynamics(0.0, h, v, a), m * a + m * g, rtol=0, atol=1e-15 * m * (g + 5))
        np.testing.assert_allclose(ball.forward_dynamics(0.0, h, v, F), F / m - g, rtol=0, atol=1e-15 * (5 / m + g))


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
    a = free_body().forward_dynamics(0.0, q, v, Q)
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
    np.testing.assert_allclose(rolling.forward_dynamics(0.0, [0.4], [-1.2], [0.0]), [expected], rtol=1e-14)

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
