"""UR5 draws a circle: control in operational space, with the exact model and with one that is 20 % too heavy.

    F = Λ (ẍ_d + kd ė + kp e) + μ + p,    τ = Jᵀ F,    Λ = (J M⁻¹ Jᵀ)⁻¹

With the exact model the error obeys ë + kd ė + kp e = 0: it starts at zero and stays there. What is left of the radius
error is the reference's own: `rd.control.circle` is made of quintics, within 1e-9 of the radius.

Run: python examples/ur5_circle.py
"""

from __future__ import annotations

import numpy as np

import robot_dyn as rd

frame = "tool0"
radius = 0.10  # [m]
normal = np.array([0.0, 0.0, 1.0])  # a horizontal circle
period_s = 2.0
q_start = np.array([0.0, -1.2, 1.8, -2.2, -1.57, 0.0])  # [rad]

arm = rd.load("ur5")
kp, kd = rd.control.gains_from(1.0, 20.0)  # ω = 20 rad/s, critically damped

# The circle passes through the place where the arm stands, and the tool keeps its orientation.
start = arm.placement(q_start, frame)
spoke = np.array([radius, 0.0, 0.0])  # from the centre to the start, in [m]
centre = start[:3, 3] - spoke
circle = rd.control.circle(centre, radius, normal, period_s, toward=spoke, rotation=start[:3, :3])

for name, model in (("exact model", arm), ("model 20 % too heavy", arm.with_(mass_scale=1.2))):
    trajectory = rd.simulate(
        rd.Plant(arm),
        q0=q_start,
        v0=np.zeros(arm.n),
        duration_s=circle.position.end_s,
        controller=rd.control.OperationalSpace(model, frame, circle, kp=kp, kd=kd),
        rtol=1e-8,
        atol=1e-10,
        record_every_s=0.01,
    )
    print(f"--- {name}\n{trajectory.summary}")

    p = arm.placement(trajectory.q, frame)[:, :3, 3]
    desired, _, _ = circle.position.at(trajectory.t)
    off_radius = np.abs(np.linalg.norm((p - centre)[:, :2], axis=1) - radius).max()
    off_plane = np.abs((p - centre) @ normal).max()
    tracking = np.sqrt(np.mean(np.sum((p - desired) ** 2, axis=1)))
    print(f"tracking error of the tool: {tracking:.3e} m rms, off the plane by {off_plane:.3e} m")
    print(f"radius error, {name}: {off_radius:.3e} m\n")
