"""2R planar arm of two uniform bars: M(q) a + C(q, v) v + N(q) = τ from K and V, against its closed form.

Run: python examples/textbook/planar_2r.py
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from robot_dyn.description.solids import box
from robot_dyn.lagrange.euler_lagrange import euler_lagrange

m1, m2, l1, l2, g = 2.0, 1.5, 1.0, 0.8, 9.80665  # the arm of urdf/planar_2r, in [kg], [m] and [m / s²]
r1, r2 = l1 / 2, l2 / 2  # where the centres of mass are
I1, I2 = box(m1, l1, 0.05, 0.05).inertia[2, 2], box(m2, l2, 0.05, 0.05).inertia[2, 2]


def centres(q):
    """Centres of mass of the bars in [m], y upwards."""
    p1 = ca.vertcat(r1 * ca.cos(q[0]), r1 * ca.sin(q[0]))
    p2 = ca.vertcat(l1 * ca.cos(q[0]) + r2 * ca.cos(q[0] + q[1]), l1 * ca.sin(q[0]) + r2 * ca.sin(q[0] + q[1]))
    return p1, p2


def kinetic(t, q, v):
    """K = Σ ½ m ‖ṗ‖² + ½ I ω² in [J]; CasADi differentiates the positions, so no sign can slip."""
    v1, v2 = (ca.jtimes(p, q, v) for p in centres(q))
    return (m1 * ca.sumsqr(v1) + I1 * v[0] ** 2 + m2 * ca.sumsqr(v2) + I2 * (v[0] + v[1]) ** 2) / 2


def potential(t, q):
    """V = Σ m g y in [J]."""
    return g * sum(m * p[1] for m, p in zip((m1, m2), centres(q), strict=True))


arm = euler_lagrange(kinetic, potential, n=2)
q, v, a = np.array([0.6, -1.1]), np.array([0.9, -0.4]), np.array([1.5, 2.0])
print("M =", arm.M(q, v), "C =", arm.C(q, v), "N =", arm.N(q), sep="\n")
tau = arm.inverse_dynamics(q, v, a)

c2, c12, h = np.cos(q[1]), np.cos(q.sum()), -m2 * l1 * r2 * np.sin(q[1])
M12 = m2 * (r2**2 + l1 * r2 * c2) + I2
M = [[m1 * r1**2 + I1 + m2 * (l1**2 + r2**2 + 2 * l1 * r2 * c2) + I2, M12], [M12, m2 * r2**2 + I2]]
C = [[h * v[1], h * v.sum()], [-h * v[0], 0]]
N = g * np.array([(m1 * r1 + m2 * l1) * np.cos(q[0]) + m2 * r2 * c12, m2 * r2 * c12])
closed_form = np.array(M) @ a + np.array(C) @ v + N
print(f"torque for a = {a}: {tau} N m; closed form {closed_form} N m")


def motion(t, x):
    """State (q, v) → (v, a), no torque."""
    return np.concatenate([x[2:], arm.forward_dynamics(x[:2], x[2:], [0, 0])])


run = solve_ivp(motion, (0, 2), [*q, *v], method="DOP853", rtol=1e-11, atol=1e-11)
E = arm.energy(run.y[:2].T, run.y[2:].T)  # at all steps at once
print(f"swinging freely for 2 s: energy {E[0]:.9f} J, drift {np.abs(E - E[0]).max():.1e} J")
print(f"residual: {max(np.abs(tau - closed_form).max(), np.abs(E - E[0]).max()):.1e}")
