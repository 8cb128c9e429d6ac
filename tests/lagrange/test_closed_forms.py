"""The textbook's closed forms: pendulum, 2R arm, cart and pole, against both implementations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robot_dyn as rd
from robot_dyn.description import check

ENGINES = (lambda robot: robot, rd.Lagrangian)
POSITIVE = st.floats(0.1, 5.0)
ANGLE, RATE = st.floats(-3.0, 3.0), st.floats(-4.0, 4.0)


def planar_2r(m: list[float], r: list[float], l1: float, I: list[float]) -> rd.Robot:  # noqa: E741
    """The 2R arm of equations in the plane x–y with gravity along −y."""

    def link(name: str, m: float, r: float, izz: float) -> str:
        return (
            f'<link name="{name}"><inertial><origin xyz="{r!r} 0 0"/><mass value="{m!r}"/>'
            f'<inertia ixx="{izz!r}" ixy="0" ixz="0" iyy="{izz!r}" iyz="0" izz="{izz!r}"/></inertial></link>'
        )

    def joint(name: str, parent: str, child: str, x: float) -> str:
        return (
            f'<joint name="{name}" type="continuous"><origin xyz="{x!r} 0 0"/><parent link="{parent}"/>'
            f'<child link="{child}"/><axis xyz="0 0 1"/></joint>'
        )

    text = (
        '<robot name="2r"><link name="base"/>'
        + "".join(link(*x) for x in zip(("one", "two"), m, r, I, strict=True))
        + joint("q1", "base", "one", 0.0)
        + joint("q2", "one", "two", l1)
        + "</robot>"
    )
    return rd.Robot(check(text.encode(), "2r")).with_(gravity=(0.0, -9.81, 0.0))


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
    """M, C, N of Spong's 2R arm at random parameters; a dozen roundings of the largest terms, so 1e-14 of them."""
    (m1, m2), (r1, r2), (I1, I2), (q1, q2), (v1, v2), g = m, r, I, q, v, 9.81
    M12 = m2 * (r2**2 + l1 * r2 * np.cos(q2)) + I2
    M11 = m1 * r1**2 + I1 + m2 * (l1**2 + r2**2 + 2 * l1 * r2 * np.cos(q2)) + I2
    M = np.array([[M11, M12], [M12, m2 * r2**2 + I2]])
    h = -m2 * l1 * r2 * np.sin(q2)
    C = np.array([[h * v2, h * (v1 + v2)], [-h * v1, 0.0]])
    N2 = g * m2 * r2 * np.cos(q1 + q2)
    N = np.array([g * (m1 * r1 + m2 * l1) * np.cos(q1) + N2, N2])
    terms = m1 * r1**2 + I1 + m2 * (l1 + r2) ** 2 + I2
    robot = planar_2r(m, r, l1, I)
    for engine in ENGINES:
        dynamics = engine(robot)
        np.testing.assert_allclose(dynamics.M(q), M, rtol=0, atol=1e-14 * terms)
        np.testing.assert_allclose(dynamics.C(q, v), C, rtol=0, atol=1e-14 * terms * (1 + abs(v1) + abs(v2)))
        np.testing.assert_allclose(dynamics.N(q), N, rtol=0, atol=1e-14 * g * (m1 * r1 + m2 * (l1 + r2)))


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
