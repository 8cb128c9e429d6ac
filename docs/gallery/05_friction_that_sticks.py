"""Friction that sticks.

Two links fall against dry friction. Each joint comes to rest and stays there exactly; the lanes show when it is held.
"""

import robot_dyn as rd

arm = rd.load("planar_2r")
friction = rd.effects.DryFriction([9.0, 3.0], static=[12.0, 4.0])  # N m
run = rd.simulate(rd.Plant(arm, [friction]), q0=[0.4, 0.9], duration_s=4.0, record_every_s=0.01)
page = rd.replay(run, frame="tip")
