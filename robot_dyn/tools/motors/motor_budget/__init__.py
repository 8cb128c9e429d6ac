"""What a motion asks of motors, and whether they suffice: torque, speed, power and energy of each joint, by cause.

budget            rd.tools.motors.budget: of a plan or a run, against limits
result            the answer: what each joint needs, headroom, causes
demand            torque and speed at the times of a plan, or at the samples of a run
cells             a motion in cells in which it is smooth, with a rule of integration
breakaway         torque at which joints with static friction leave rest
largest_payload   the largest payload with which the motors suffice, in closed form at each time
fastest           the path of a motion at its limits, from stop to stop
pace              the least factor by which it is slowed down to keep continuous torques
diagram           the figure
"""
