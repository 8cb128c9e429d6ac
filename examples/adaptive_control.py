"""Adaptive control of Slotine and Li: a two-link arm whose masses the controller does not know.

The inertial parameters θ enter the equation linearly. With e = q_d − q, v_r = v_d + Λ e, a_r = a_d + Λ ė, s = v − v_r:

    M a_r + C v_r + N = Y(q, v, a_r, v_r) θ
    τ = Y θ̂ − K s,    dθ̂/dt = −Γ Yᵀ s
    V = (sᵀ M s + θ̃ᵀ Γ⁻¹ θ̃)/2 with θ̃ = θ̂ − θ,    dV/dt = −sᵀ K s ≤ 0

States of a controller start at zero, hence z = θ̂ − θ̂(0). Source: Slotine, Li, On the adaptive control of robot
manipulators, International Journal of Robotics Research 6(3), 1987.

Run: python examples/adaptive_control.py
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import robot_dyn as rd

slope, damping, adaptation = 5.0, np.array([20.0, 10.0]), 10.0  # Λ in [1/s], K in [N m s/rad], Γ


@dataclass(frozen=True, eq=False)
class SlotineLi(rd.control.Controller):
    """The law above; its states are the change of the estimate."""

    model: rd.Robot
    reference: rd.control.PiecewisePolynomial
    guess: np.ndarray  # θ̂(0), (20,)
    n, state_size, thresholds = 2, 20, lambda self: ()

    def terms(self, t, q, v):
        q_d, v_d, a_d = self.reference.at(t)
        v_r, a_r = v_d + slope * (q_d - q), a_d + slope * (v_d - v)
        return self.model.regressor(q, v, a_r, v_r), v - v_r

    def torque(self, t, q, v, z):
        Y, s = self.terms(t, q, v)
        return Y @ (self.guess + z) - damping * s

    def state_rate(self, t, q, v, z):
        Y, s = self.terms(t, q, v)
        return -adaptation * (Y.T @ s)


arm = rd.load("planar_2r")
times = np.linspace(0.0, 10.0, 11)
points = np.array([[0.5 * np.sin(1.3 * t) + 0.4, 0.8 * np.cos(0.9 * t) - 0.6] for t in times])
path = rd.control.via_points(times, points)
theta = arm.inertial_parameters
controller = SlotineLi(arm, path, 0.6 * theta)  # 60 % of every parameter
run = rd.simulate(arm, q0=points[0], duration_s=10.0, controller=controller, record_every_s=0.01)
print(run.summary)

q_d, v_d, _ = path.at(run.t)
s = run.v - v_d - slope * (q_d - run.q)
wrong = controller.guess + run.controller_states - theta
V = (np.einsum("mi,mij,mj->m", s, arm.M(run.q), s) + (wrong**2).sum(axis=1) / adaptation) / 2
spent = np.trapezoid((damping * s**2).sum(axis=1), run.t)
error = np.abs(run.tracking_error).max(axis=1)
print(
    f"error at most {error[run.t < 2].max():.4f} rad in the first 2 s, {error[run.t > 8].max():.4f} rad in the last 2 s"
)
print(f"V falls by {V[0] - V[-1]:.6f} J; the integral of sᵀ K s is {spent:.6f} J")
