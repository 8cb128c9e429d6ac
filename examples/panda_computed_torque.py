"""Panda under four controllers of the same frequency ω and damping ζ, whose model is 20 % too heavy.

    PD                  τ = kp e + kd ė                              kp = diag(M̂) ω²,  kd = 2 ζ ω diag(M̂)
    PID                 τ = kp e + kd ė + ki ∫ e dt                  ki = kp ω/4
    PD + gravity        τ = kp e + kd ė + N̂(q)
    computed torque     τ = M̂ (a_d + 2 ζ ω ė + ω² e) + Ĉ v + N̂

A hat marks the controller's model; the arm itself moves by M, C, N. At rest PD leaves kp e = N, PD with gravity
kp e = N − N̂, computed torque M̂ ω² e = N − N̂; the integral leaves nothing.

Run: python examples/panda_computed_torque.py
"""

from __future__ import annotations

import numpy as np

import robot_dyn as rd

omega = 20.0  # ω, in [rad/s]
zeta = 1.0  # ζ, critical damping
move_s, duration_s = 1.5, 4.0  # the rest of the time it holds still

arm = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
model = arm.with_(mass_scale=1.2)

q_start = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])  # [rad]
q_end = np.array([0.8, -0.2, -0.4, -2.0, 0.3, 2.0, 1.2])
plan = rd.control.quintic(q_start, q_end, move_s)

inertia = np.diag(model.M((q_start + q_end) / 2))
kp, kd = rd.control.gains_from(inertia, omega, zeta)  # in [N m/rad], [N m s/rad]
ki = kp * omega / 4  # [N m/(rad s)]; stable for ki < 2 ζ ω kp

controllers = {
    "PD": rd.control.PD(plan, kp=kp, kd=kd),
    "PID": rd.control.PID(plan, kp=kp, ki=ki, kd=kd),
    "PD + gravity": rd.control.PDGravity(model, plan, kp=kp, kd=kd),
    "computed torque": rd.control.ComputedTorque(model, plan, bandwidth_rad_s=omega, damping_ratio=zeta),
}

rows = []
for name, controller in controllers.items():
    trajectory = rd.simulate(
        rd.Plant(arm),
        q0=q_start,
        v0=np.zeros(arm.n),
        duration_s=duration_s,
        controller=controller,
        rtol=1e-8,
        atol=1e-10,  # the gains make the arm stiff: the method chooses its steps
        record_every_s=0.01,
    )
    print(f"--- {name}\n{trajectory.summary}\n")
    error = np.abs(trajectory.q - trajectory.desired).max(axis=1)
    rows.append((name, trajectory.rms_tracking_error, error.max(), error[-1]))

print(f"{'':<16} {'rms [rad]':>12} {'largest [rad]':>14} {'at the end [rad]':>17}")
for name, rms, largest, final in rows:
    print(f"{name:<16} {rms:12.3e} {largest:14.3e} {final:17.3e}")
