"""Computed torque with a model that is 20 % too heavy.

Opaque the exact model, transparent the wrong one: the plots show the tracking error and the settings that differ.
"""

import numpy as np

import robot_dyn as rd

arm = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
start = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])  # rad
plan = rd.control.quintic(start, start + np.array([0.8, 0.6, -0.4, 0.3, 0.3, 0.4, 0.4]), duration_s=1.5)
runs = [
    rd.simulate(
        arm,
        start,
        duration_s=2.0,
        record_every_s=0.01,
        controller=rd.control.ComputedTorque(m, plan, bandwidth_rad_s=20.0),
    )
    for m in (arm, arm.with_(mass_scale=1.2))
]
page = rd.replay(*runs, meshes="coarse")
