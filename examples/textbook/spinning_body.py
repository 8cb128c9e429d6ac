"""Free spinning body: Euler's I ω̇ + ω × I ω = 0 from K, two constants of motion, and the middle axis that turns over.

Run: python examples/textbook/spinning_body.py
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from robot_dyn.description.solids import box
from robot_dyn.foundations.spatial import hat
from robot_dyn.lagrange.euler_lagrange import euler_lagrange
from robot_dyn.lagrange.rigid_body import angular_momentum, body_acceleration, kinetic_energy

book = box(1.2, 0.3, 0.2, 0.05)  # [kg], edges in [m]: I₁ < I₂ < I₃ along x, y, z


def omega_of(q, v):
    """ω in body axes of roll, pitch, yaw and their rates."""
    x, y = q[0], q[1]
    yaw = ca.vertcat(-ca.sin(y), ca.sin(x) * ca.cos(y), ca.cos(x) * ca.cos(y))
    return ca.vertcat(v[0], ca.cos(x) * v[1], -ca.sin(x) * v[1]) + yaw * v[2]


body = euler_lagrange(lambda t, q, v: ca.dot(omega_of(q, v), ca.DM(book.inertia) @ omega_of(q, v)) / 2, None, n=3)

# 1. Lagrange in angles says what Euler says in body axes: compare ω̇ at one state.
angles, rates = np.array([0.4, -0.7, 1.2]), np.array([1.0, -2.0, 0.5])
a = body.forward_dynamics(angles, rates, np.zeros(3))
q, v = ca.SX.sym("q", 3), ca.SX.sym("v", 3)
omega_dot = ca.jtimes(omega_of(q, v), ca.vertcat(q, v), ca.vertcat(v, ca.DM(a)))
by_lagrange = ca.Function("omega_dot", [q, v], [omega_dot])(angles, rates).full()[:, 0]
omega = ca.Function("omega", [q, v], [omega_of(q, v)])(angles, rates).full()[:, 0]
by_euler = body_acceleration(book, [0, 0, 0, *omega], np.zeros(6))[3:]
print(f"ω̇ by Lagrange {by_lagrange}\nω̇ by Euler    {by_euler}")


def motion(t, state):
    """State (ω, R) → (ω̇, R ω̂)."""
    omega, R = state[:3], state[3:].reshape(3, 3)
    return np.concatenate([body_acceleration(book, [0, 0, 0, *omega], np.zeros(6))[3:], (R @ hat(omega)).ravel()])


# 2. A spin of 8 rad/s about each axis, nudged by 0.01 rad/s, for 3 s.
residual = np.abs(by_lagrange - by_euler).max()
for k, name in enumerate(("smallest", "middle", "largest")):
    start = 8.0 * np.eye(3)[k] + 0.01
    run = solve_ivp(motion, (0, 3), [*start, *np.eye(3).ravel()], method="DOP853", rtol=1e-11, atol=1e-13)
    omega, R = run.y[:3].T, run.y[3:].T.reshape(-1, 3, 3)
    K = kinetic_energy(book, np.hstack([np.zeros_like(omega), omega]))
    L = angular_momentum(book, R, np.matvec(R, omega))
    residual = max(residual, np.abs(K / K[0] - 1).max(), np.abs(L - L[0]).max() / np.linalg.norm(L[0]))
    print(f"axis of the {name:8} moment: ω along it from 8.01 down to {omega[:, k].min():6.3f} rad/s")
print("energy and the world's angular momentum are kept; the middle axis turns over")
print(f"residual: {residual:.1e}")
