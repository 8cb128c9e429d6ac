"""Panda with a payload that its controller does not know: feed-forward against computed torque.

    feed-forward        τ = M(q_d) a_d + C(q_d, v_d) v_d + N(q_d) + kp e + kd ė,  kp = diag(M) ω²,  kd = 2 ζ ω diag(M)
    computed torque     τ = M(q) (a_d + 2 ζ ω ė + ω² e) + C(q, v) v + N(q)

Without the payload both models are exact. With it the arm asks for ΔM q̈ + ΔC v + ΔN more than they give, which only
the error can make up for.

Run: python examples/panda_payload.py
"""

from __future__ import annotations

import numpy as np

import robot_dyn as rd

omega, zeta = 20.0, 1.0  # ω in [rad/s], ζ
move_s, duration_s = 1.5, 2.5
payload = rd.Payload("panda_hand", mass=2.0, com=(0.0, 0.0, 0.1))  # [kg], [m]

model = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
arms = {"empty hand": model, "2 kg in the hand": model.with_(payload=payload)}

q_start = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])  # [rad]
q_end = np.array([0.8, -0.2, -0.4, -2.0, 0.3, 2.0, 1.2])
plan = rd.control.quintic(q_start, q_end, move_s)

kp, kd = rd.control.gains_from(np.diag(model.M((q_start + q_end) / 2)), omega, zeta)
controllers = {
    "feed-forward": rd.control.FeedForward(model, plan, kp=kp, kd=kd),
    "computed torque": rd.control.ComputedTorque(model, plan, bandwidth_rad_s=omega, damping_ratio=zeta),
}

rows = []
for carried, arm in arms.items():
    for name, controller in controllers.items():
        trajectory = rd.simulate(
            rd.Plant(arm),
            q0=q_start,
            v0=np.zeros(arm.n),
            duration_s=duration_s,
            controller=controller,
            rtol=1e-8,
            atol=1e-10,
            record_every_s=0.01,
        )
        print(f"--- {name}, {carried}\n{trajectory.summary}\n")
        error = np.abs(trajectory.q - trajectory.desired).max(axis=1)
        rows.append((f"{name}, {carried}", trajectory.rms_tracking_error, error[-1]))

print(f"what the payload costs at rest: {(arms['2 kg in the hand'].N(q_end) - model.N(q_end)).round(2)} N m")
print(f"{'':<34} {'rms [rad]':>12} {'at the end [rad]':>17}")
for name, rms, final in rows:
    print(f"{name:<34} {rms:12.3e} {final:17.3e}")
