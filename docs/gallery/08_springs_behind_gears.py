"""Motors behind springs.

Springs between gears and joints of a planar arm: the links lag behind the plan, and settle after it.
"""

import robot_dyn as rd

arm = rd.load("planar_2r")
drive = rd.effects.SeriesElastic(stiffness=900.0, inertia=2e-4, ratio=80.0, damping=5.0, viscous=5.0)
plan = rd.control.quintic([-1.4, 0.3], [0.2, -0.6], duration_s=1.0)
law = rd.control.PDGravity(arm, plan, kp=60.0, kd=20.0)
run = rd.simulate(rd.Plant(arm, [drive]), [-1.4, 0.3], duration_s=2.5, controller=law, record_every_s=0.01)
page = rd.replay(run, frame="tip")
