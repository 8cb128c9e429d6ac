"""A UR5 draws a circle.

Control in operational space: the tool follows the path and keeps its orientation; its path is drawn.
"""

import numpy as np

import robot_dyn as rd

arm = rd.load("ur5")
start = np.array([0.0, -1.2, 1.8, -2.2, -1.57, 0.0])  # rad
pose = arm.placement(start, "tool0")
spoke = np.array([0.1, 0.0, 0.0])  # m, from the centre to the start
up = [0.0, 0.0, 1.0]
circle = rd.control.circle(pose[:3, 3] - spoke, 0.1, up, 2.0, toward=spoke, rotation=pose[:3, :3])
kp, kd = rd.control.gains_from(1.0, 20.0)
law = rd.control.OperationalSpace(arm, "tool0", circle, kp=kp, kd=kd)
run = rd.simulate(arm, start, duration_s=circle.position.end_s, controller=law, record_every_s=0.01)
page = rd.replay(run, frame="tool0", meshes="coarse")
