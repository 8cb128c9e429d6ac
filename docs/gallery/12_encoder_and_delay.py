"""A loop with an encoder, a bus and a delay.

The controller is sampled at 1 kHz and differentiates positions in steps of 0.1 mrad: the actuation shows it.
"""

import robot_dyn as rd

arm = rd.load("planar_2r")
goal = rd.control.quintic([0.2, -0.4], [0.9, 0.5], duration_s=0.5)
control = rd.control
loop = control.Loop(
    control.PDGravity(arm, goal, kp=[400.0, 200.0], kd=[40.0, 15.0], period_s=1e-3),
    position=[control.Quantisation(1e-4)],
    velocity=[control.Differences(), control.LowPass(500.0, order=1)],
    measurement_delay_periods=1.0,
    actuation_delay_periods=0.5,
)
run = rd.simulate(arm, [0.2, -0.4], duration_s=1.0, controller=loop, record_every_s=0.005)
page = rd.replay(run, frame="tip")
