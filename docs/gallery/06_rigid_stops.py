"""Two links between rigid stops.

Each impact obeys Newton's law with e = 0.6, no stop is passed, and no impact adds energy.
"""

import robot_dyn as rd

arm = rd.load("planar_2r")
stops = rd.effects.RigidStops(-1.0, 1.0, 0.6)  # rad, rad, restitution
plant = rd.Plant(arm, [stops, rd.effects.ViscousFriction(0.5)])
run = rd.simulate(plant, q0=[0.9, 0.4], v0=[2.0, 1.0], duration_s=3.0, record_every_s=0.01)
page = rd.replay(run, frame="tip")
