"""Two particles on a rod: |r₁ − r₂|² = d² leaves 6 − 1 = 5 coordinates, r₁ = (x, y, z) and the rod's angles θ, φ.

Run: python examples/textbook/two_particles_on_a_rod.py
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from robot_dyn.lagrange.generalized_force import generalized_force, lagrangian_of_particles

m1, m2, d, g = 0.8, 0.5, 0.6, 9.81  # [kg], [kg], [m], [m / s²]


def positions(t, q):
    """r₁ and r₂ in [m]; they keep the constraint whatever q is."""
    theta, phi = q[3], q[4]
    rod = ca.vertcat(ca.sin(theta) * ca.cos(phi), ca.sin(theta) * ca.sin(phi), ca.cos(theta))
    return [q[:3], q[:3] + d * rod]


system = lagrangian_of_particles([m1, m2], positions, n=5, gravity=[0, 0, -g])
force = generalized_force(positions, n=5)

q0, v0 = np.array([0.0, 0.0, 2.0, 1.1, 0.4]), np.array([0.5, -0.3, 3.0, 1.5, 4.0])
np.set_printoptions(precision=4, suppress=True)
print("M =", system.M(q0, v0), "N = ∂V/∂q =", system.N(q0), sep="\n")
push = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]])  # on r₂ alone, in [N]
print("Q_j = Σ F_i · ∂r_i/∂q_j =", force(0.0, q0, push))


def motion(t, state):
    """Free flight: state (q, v) → (v, a)."""
    q, v = np.split(state, 2)
    return np.concatenate([v, system.forward_dynamics(q, v, np.zeros(5))])


T = 0.8  # [s]
run = solve_ivp(motion, (0, T), [*q0, *v0], method="DOP853", rtol=1e-11, atol=1e-11)
q, v = np.split(run.y[:, -1], 2)
r_start, r_end = force.positions(0.0, q0), force.positions(T, q)

centre = [(m1 * r[0] + m2 * r[1]) / (m1 + m2) for r in (r_start, r_end)]
velocity = force.jacobian(0.0, q0) @ v0
exact = centre[0] + (m1 * velocity[0] + m2 * velocity[1]) / (m1 + m2) * T - np.array([0, 0, g]) * T**2 / 2
print("centre of mass after", T, "s:", centre[1], "on its parabola:", exact)
spin = [np.sin(each[3]) ** 2 * rate[4] for each, rate in ((q0, v0), (q, v))]
print(f"sin²θ φ̇, which no force changes: {spin[0]:.9f} → {spin[1]:.9f} rad/s")
drift = system.energy(q, v) - system.energy(q0, v0)
print(f"energy K + V: {system.energy(q0, v0):.9f} J, drift {drift:.1e} J")
print(f"residual: {max(np.abs(centre[1] - exact).max(), abs(spin[1] - spin[0]), abs(drift)):.1e}")
