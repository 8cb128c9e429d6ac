"""A path as fast as the motors allow.

An xArm 7 passes three points; at each time a limit of torque or velocity binds. Needs `pip install 'robot-dyn[plan]'`.
"""

import robot_dyn as rd

arm = rd.load("xarm7")
a, b, c = (
    [0.0, -0.5, 0.0, 1.0, 0.0, 1.2, 0.0],
    [0.6, 0.0, 0.2, 1.4, 0.1, 1.4, 0.3],
    [1.2, -0.4, 0.0, 0.9, 0.0, 1.0, 0.6],
)
plant = rd.Plant(arm, [rd.effects.ViscousFriction(1.0)])
path = rd.tools.motors.path(plant, [a, b, c], fraction=0.95)
law = rd.control.FeedForward(arm, path.reference, kp=500.0, kd=[50.0] * 4 + [2.0] * 3)
run = rd.simulate(plant, a, duration_s=path.duration_s, controller=law, record_every_s=0.005)
page = rd.replay(run, meshes="coarse")
