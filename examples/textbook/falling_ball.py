"""Falling ball: from K = ½ m v² and V = m g h to F = m a + m g.

Run: python examples/textbook/falling_ball.py
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from robot_dyn.lagrange.euler_lagrange import euler_lagrange

m = 0.45  # [kg]
g = 9.81  # [m / s²]
duration = 1.2  # [s]


def kinetic(t, q, v):
    """K(t, q, v) in [J]; q[0] is the height h."""
    return m * v[0] ** 2 / 2


def potential(t, q):
    """V(t, q) in [J]."""
    return m * g * q[0]


ball = euler_lagrange(kinetic, potential, n=1)
print(ball)  # M a + b = Q, with M = m and b = m g

no_force = np.zeros(1)
a = ball.forward_dynamics([2.0], [3.0], no_force)
print(f"free fall:           a = {a[0]:.4f} m/s², and a = F/m − g gives {-g:.4f}")
hold = ball.inverse_dynamics([2.0], [0.0], [0.0])
print(f"held in the hand:    F = {hold[0]:.4f} N, and m g = {m * g:.4f}")


def motion(t, state):
    """State (h, v) → (v, a)."""
    h, v = state[:1], state[1:]
    return np.concatenate([v, ball.forward_dynamics(h, v, no_force)])


h0, v0 = 2.0, 5.0  # thrown upwards
run = solve_ivp(motion, (0, duration), [h0, v0], method="DOP853", rtol=1e-12, atol=1e-12)
h = run.y[0, -1]
exact = h0 + v0 * duration - g * duration**2 / 2
print(f"after {duration} s:         h = {h:.9f} m, and h₀ + v₀ t − ½ g t² = {exact:.9f} m")
print(f"residual: {abs(h - exact):.1e}")
