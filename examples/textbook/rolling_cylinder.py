"""Cylinder that rolls down an incline without slip: a = ⅔ g sin α, by Lagrange and by Newton–Euler.

Run: python examples/textbook/rolling_cylinder.py
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from robot_dyn.description.solids import cylinder
from robot_dyn.lagrange.euler_lagrange import euler_lagrange
from robot_dyn.lagrange.rigid_body import world_acceleration

m, r, height = 2.0, 0.15, 0.4  # [kg], [m], [m]
alpha, g = np.radians(25), 9.81  # slope, [m / s²]
I = cylinder(m, r, height).inertia[2, 2]  # about its axis: m r²/2  # noqa: E741

# 1. Lagrange. One coordinate, the way x down the slope: rolling makes the turn ω = ẋ / r.
rolling = euler_lagrange(
    lambda t, q, v: m * v[0] ** 2 / 2 + I * (v[0] / r) ** 2 / 2,
    lambda t, q: -m * g * np.sin(alpha) * q[0],
    n=1,
)
print(rolling)
a = rolling.forward_dynamics([0.0], [0.0], [0.0])[0]
print(f"Lagrange:         a = {a:.6f} m/s²;  ⅔ g sin α = {2 / 3 * g * np.sin(alpha):.6f}")

# 2. Newton–Euler. x down the slope, y off it, z along the axis; the contact at (0, −r, 0) pushes and rubs.
weight = m * g * np.array([np.sin(alpha), -np.cos(alpha), 0])
contact = np.array([-m * g * np.sin(alpha) / 3, m * g * np.cos(alpha), 0])
torque = np.cross([0, -r, 0], contact)
p_ddot, omega_dot = np.split(
    world_acceleration(cylinder(m, r, height), np.eye(3), np.zeros(3), np.concatenate([weight + contact, torque])), 2
)
print(f"Newton–Euler:     a = {p_ddot[0]:.6f} m/s²;  −r ω̇ = {-r * omega_dot[2]:.6f}, so it rolls")
print(f"a block sliding:  a = {g * np.sin(alpha):.6f} m/s²: a third of the work goes into the turn")


def motion(t, state):
    """State (x, v) → (v, a)."""
    return np.array([state[1], rolling.forward_dynamics(state[:1], state[1:], [0.0])[0]])


run = solve_ivp(motion, (0, 1.5), [0.0, 0.3], method="DOP853", rtol=1e-12, atol=1e-12)
exact = 0.3 * 1.5 + 2 / 3 * g * np.sin(alpha) * 1.5**2 / 2
print(f"after 1.5 s:      x = {run.y[0, -1]:.9f} m;  v₀ t + ⅓ g sin α t² = {exact:.9f} m")
print(f"residual: {max(abs(run.y[0, -1] - exact), abs(a - p_ddot[0])):.1e}")
