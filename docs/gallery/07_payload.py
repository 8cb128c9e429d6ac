"""A UR5 picks up 3 kg and drops them.

The controller knows nothing of it: M, C and N change while the payload is carried, and the arm sags.
"""

import numpy as np

import robot_dyn as rd

arm = rd.load("ur5")
start = np.array([0.0, -1.2, 1.4, -1.8, -1.57, 0.0])  # rad
plan = rd.control.quintic(start, start + np.array([0.9, 0.3, -0.4, 0.1, 0.0, 0.0]), duration_s=2.0)
load = rd.effects.CarriedPayload(rd.Payload("tool0", 3.0), start_s=0.5, end_s=1.6)
law = rd.control.ComputedTorque(arm, plan, bandwidth_rad_s=15.0)
run = rd.simulate(rd.Plant(arm, [load]), start, duration_s=2.5, controller=law, record_every_s=0.01)
page = rd.replay(run, frame="tool0", meshes="coarse")
