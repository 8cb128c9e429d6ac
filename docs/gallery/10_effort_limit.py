"""A motor that is too small.

A Kinova moves 8 kg that its controller knows of: at the effort limit of its wrist the actuation is cut.
"""

import numpy as np

import robot_dyn as rd

arm = rd.load("kinova").with_(payload=rd.Payload("j2s6s200_end_effector", 8.0))
start = np.array([0.0, 2.9, 1.9, 0.0, 1.5, 0.0])  # rad
plan = rd.control.quintic(start, start + np.array([0.5, -0.6, 0.5, 0.4, 0.0, 0.0]), duration_s=1.5)
law = rd.control.ComputedTorque(arm, plan, bandwidth_rad_s=15.0)
plant = rd.Plant(arm, [rd.effects.EffortLimit("urdf"), rd.effects.ViscousFriction(0.2)])
run = rd.simulate(plant, start, duration_s=2.0, controller=law, record_every_s=0.01)
page = rd.replay(run, meshes="coarse")
