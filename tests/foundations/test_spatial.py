"""Rigid motions, twists and wrenches (rows A1, A2, A6 of the equations)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from robot_dyn.foundations import (
    adjoint,
    adjoint_inverse,
    bracket,
    hat,
    homogeneous,
    rotation,
    rotation_rpy,
    rpy_of,
    spatial_inertia,
)

VECTORS = arrays(np.float64, 3, elements=st.floats(-2, 2))
TWISTS = arrays(np.float64, 6, elements=st.floats(-2, 2))


def placement(p: np.ndarray, rpy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return rotation_rpy(rpy), p


@given(VECTORS, VECTORS)
def test_hat_is_the_cross_product(a, b) -> None:
    """The product â b is a × b; one rounding of products up to 4, 1e-15."""
    np.testing.assert_allclose(hat(a) @ b, np.cross(a, b), atol=1e-15)


@given(VECTORS.filter(lambda a: np.linalg.norm(a) > 0.1), st.floats(-10, 10))
def test_rotation_keeps_lengths_and_its_axis(axis, angle) -> None:
    """RᵀR = 1, det R = 1, R â = â; ten roundings, 1e-14."""
    axis = axis / np.linalg.norm(axis)
    R = rotation(axis, angle)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(R), 1, atol=1e-14)
    np.testing.assert_allclose(R @ axis, axis, atol=1e-14)


@given(VECTORS, VECTORS, TWISTS, TWISTS)
def test_power_is_the_same_in_every_frame(p, rpy, V_c, F_b) -> None:
    """V_b = Ad V_c and F_c = Adᵀ F_b give V_b·F_b = V_c·F_c (row A2)."""
    Ad = adjoint(*placement(p, rpy))
    np.testing.assert_allclose((Ad @ V_c) @ F_b, V_c @ (Ad.T @ F_b), atol=1e-12)


@given(VECTORS, VECTORS)
def test_adjoint_has_its_inverse(p, rpy) -> None:
    g = placement(p, rpy)
    np.testing.assert_allclose(adjoint(*g) @ adjoint_inverse(*g), np.eye(6), atol=1e-13)


@given(VECTORS, VECTORS, TWISTS)
def test_adjoint_turns_a_twist_like_its_matrix(p, rpy, V) -> None:
    """As 4 × 4 matrices, the hat of Ad_g V is g V̂ g⁻¹ (Murray, Li, Sastry 1994, lemma 2.13)."""
    R, p = placement(p, rpy)
    g = homogeneous(R, p)

    def matrix(V: np.ndarray) -> np.ndarray:
        return np.vstack([np.column_stack([hat(V[3:]), V[:3]]), np.zeros(4)])

    np.testing.assert_allclose(matrix(adjoint(R, p) @ V), g @ matrix(V) @ np.linalg.inv(g), atol=1e-12)


@given(TWISTS, TWISTS, TWISTS)
def test_bracket_is_a_lie_bracket(U, V, W) -> None:
    """[V, W] = −[W, V], and Jacobi's identity."""
    np.testing.assert_allclose(bracket(V) @ W, -bracket(W) @ V, atol=1e-14)
    total = bracket(U) @ bracket(V) @ W + bracket(V) @ bracket(W) @ U + bracket(W) @ bracket(U) @ V
    np.testing.assert_allclose(total, np.zeros(6), atol=1e-12)


@given(VECTORS, VECTORS, VECTORS, TWISTS)
def test_kinetic_energy_is_the_same_in_every_frame(p, rpy, com, V_c) -> None:
    """𝓜_c = Adᵀ 𝓜_b Ad keeps ½ Vᵀ 𝓜 V (row A6)."""
    inertia = spatial_inertia(2.5, com, np.diag([0.2, 0.3, 0.4]))
    Ad = adjoint(*placement(p, rpy))
    V_b = Ad @ V_c
    np.testing.assert_allclose(V_c @ Ad.T @ inertia @ Ad @ V_c, V_b @ inertia @ V_b, atol=1e-11)


@given(VECTORS, TWISTS)
def test_spatial_inertia_is_the_energy_of_its_points(com, V) -> None:
    """½ Vᵀ 𝓜 V = ½ m |v + ω × c|² + ½ ωᵀ I ω (row A3)."""
    m, inertia = 1.7, np.array([[0.3, 0.02, 0.01], [0.02, 0.4, -0.03], [0.01, -0.03, 0.5]])
    v, omega = V[:3], V[3:]
    velocity = v + np.cross(omega, com)
    energy = m * velocity @ velocity + omega @ inertia @ omega
    np.testing.assert_allclose(V @ spatial_inertia(m, com, inertia) @ V, energy, atol=1e-11)


@pytest.mark.parametrize("pitch", [0.4, -1.2, np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, -np.pi / 2 + 1e-12, 3.0])
def test_roll_pitch_and_yaw_give_the_rotation_back_also_at_right_angles_of_the_pitch(pitch: float) -> None:
    """Where roll and yaw are not determined one by one, their sum or difference is; three products of rounding."""
    for roll, yaw in ((0.3, -0.7), (2.9, 3.1), (0.0, 0.0), (-1.4, 2.2)):
        R = rotation_rpy(np.array([roll, pitch, yaw]))
        assert np.abs(rotation_rpy(rpy_of(R)) - R).max() < 1e-15 * 3
