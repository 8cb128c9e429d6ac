"""The systems of deck 000, one test a row of the equations: A1–A6, the rigid body; its motion in another file."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robot_dyn.description import MassProperties, box, combined, cylinder, ellipsoid, from_density, sphere
from robot_dyn.foundations import adjoint, adjoint_inverse, hat, homogeneous, rotation, rotation_rpy
from robot_dyn.lagrange import body_acceleration, point_velocity
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
    table = [  # solid, its integral, volume, moments per mass
        (
            box,
            (a, b, c),
            from_density(lambda x: rho, -half, half),
            a * b * c,
            np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2]) / 12,
        ),
        (
            cylinder,
            (a, b),
            integrals["cylinder"],
            np.pi * a**2 * b,
            np.array([(3 * a**2 + b**2) / 12] * 2 + [a**2 / 2]),
        ),
        (
            ellipsoid,
            (a, b, c),
            integrals["ellipsoid"],
            4 * np.pi * a * b * c / 3,
            np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2]) / 5,
        ),
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
