"""The demand of a motion on motors, compared with limits: torque, speed, power and energy of each joint, by cause.

budget            rd.tools.motors.budget: the budget of a plan or a run
result            the result: demand on each joint, headroom, causes
demand            torque and speed at the times of a plan, or at the samples of a run
cells             cells in which a motion is smooth, with a rule of integration
breakaway         torque at which joints with static friction leave rest
bearing_loads     the largest axial and radial force, tilting moment and torsion at each joint
holding           the torque of gravity that brakes hold
largest_payload   the largest payload with which the motors suffice, in closed form at each time
fastest           the path of a motion at its limits, from stop to stop
pace              the smallest factor on the duration that satisfies continuous torques
diagram           the figure
"""
