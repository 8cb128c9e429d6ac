"""Rodas5P's runs of stiff scenes against an engine that shares nothing with them: CVODES (BDF), as CasADi has it.

The equations of the planar arm are written by hand, as in docs/developers/extending.md.
[Hindmarsh et al., SUNDIALS, 2005]
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import robot_dyn as rd

M1, M2, L1, R1, R2, I1, I2, G = 2.0, 1.5, 1.0, 0.5, 0.4, 0.16708333333333333, 0.0803125, 9.80665
DELTA = I2 + M2 * R2**2
ALPHA, BETA = I1 + M1 * R1**2 + M2 * L1**2 + DELTA, M2 * L1 * R2
GAMMA = (M1 * R1 + M2 * L1) * G, M2 * R2 * G
START, DURATION = np.array([0.4, -0.7]), 0.05


def by_cvodes(damping: float, stiffness: float, rest: np.ndarray) -> np.ndarray:
    """The state q, v at the end."""
    q, v = ca.SX.sym("q", 2), ca.SX.sym("v", 2)
    c, s = ca.cos(q[1]), ca.sin(q[1])
    M = ca.blockcat([[ALPHA + 2 * BETA * c, DELTA + BETA * c], [DELTA + BETA * c, DELTA]])
    coriolis = ca.vertcat(-BETA * s * v[1] * (2 * v[0] + v[1]), BETA * s * v[0] ** 2)
    far = GAMMA[1] * ca.cos(q[0] + q[1])
    gravity = ca.vertcat(GAMMA[0] * ca.cos(q[0]) + far, far)
    a = ca.solve(M, -coriolis - gravity - damping * v - stiffness * (q - rest))
    problem = {"x": ca.vertcat(q, v), "ode": ca.vertcat(v, a)}
    options = {"reltol": 1e-13, "abstol": 1e-14, "max_num_steps": 10**6}
    end = ca.integrator("end", "cvodes", problem, 0.0, DURATION, options)(x0=[*START, 0.0, 0.0])
    return np.array(end["xf"])[:, 0]


@pytest.mark.parametrize(("damping", "stiffness"), [(300.0, 2e4), (2e3, 1e5)])
def test_rosenbrock_agrees_with_cvodes_in_a_stiff_scene(damping: float, stiffness: float) -> None:
    """On the way to rest, at k/b = 67 and 50 per second. They differ by 2e-13 rad and 6e-12 rad/s."""
    rest = START + np.array([0.1, -0.05])
    plant = rd.Plant(rd.load("planar_2r"), [rd.effects.ViscousFriction(damping), rd.effects.Spring(stiffness, rest)])
    options = {"duration_s": DURATION, "record_every_s": DURATION, "estimate_error": False}
    run = rd.simulate(plant, START, method=rd.integrate.Adaptive("Rodas5P", 1e-11, 1e-11), **options)
    theirs = by_cvodes(damping, stiffness, rest)
    np.testing.assert_allclose(run.q[-1], theirs[:2], rtol=0, atol=1e-11)
    np.testing.assert_allclose(run.v[-1], theirs[2:], rtol=0, atol=1e-10)
    assert np.abs(run.q[-1] - START).max() > 0.01
