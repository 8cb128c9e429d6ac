"""A Panda that swings freely.

Nothing acts but gravity. The bars at the cursor show how inertia, Coriolis terms and gravity balance at each joint.
"""

import robot_dyn as rd

arm = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
start = [0.3, 0.6, -0.4, -1.2, 0.5, 1.1, 0.2]  # rad
run = rd.simulate(arm, q0=start, duration_s=2.0, record_every_s=0.01)
page = rd.replay(run, frame="panda_hand", meshes="coarse")
