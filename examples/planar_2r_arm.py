"""The 2R arm under PD with viscous friction, in zero gravity and upright.

    M(q) q̈ + C(q, v) v + b v + N(q) = kp (q_d − q) − kd v

Without gravity the arm comes to rest at the target. With gravity it rests where the spring carries the weight:

    kp (q_d − q) = N(q)

Run: python examples/planar_2r_arm.py
"""

from __future__ import annotations

import numpy as np

import robot_dyn as rd

start = np.array([-np.pi / 2, 0.0])  # hangs down, in [rad]
target = np.array([0.6, 0.8])  # [rad]
kp = np.array([300.0, 100.0])  # [N m/rad]
kd = np.array([60.0, 12.0])  # [N m s/rad]
b = 0.5  # viscous friction of the joints, in [N m s/rad]


def move(arm):
    """From the start to the target in a step of the reference."""
    return rd.simulate(
        rd.Plant(arm, [rd.effects.ViscousFriction(b)]),
        q0=start,
        v0=np.zeros(2),
        duration_s=5.0,
        controller=rd.control.PD(rd.control.hold(target), kp=kp, kd=kd),
        method="DP8",
        step_s=0.002,
        record_every_s=0.01,
    )


for name, gravity in (("zero gravity", (0.0, 0.0, 0.0)), ("standard gravity", rd.STANDARD_GRAVITY)):
    arm = rd.load("planar_2r").with_(gravity=gravity)
    trajectory = move(arm)
    print(f"--- {name}\n{trajectory.summary}")
    q = trajectory.q[-1]
    work = trajectory.ledger.work
    print(f"work of the controller {work['control'][-1]:.3f} J, of friction {work['viscous_friction'][-1]:.3f} J")
    print(f"error at rest: {target - q} rad")
    print(f"N(q)/kp there: {arm.N(q) / kp} rad")
    print(f"steady error in {name}: {np.abs(target - q).max():.1e} rad\n")
