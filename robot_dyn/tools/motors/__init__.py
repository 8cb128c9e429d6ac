"""Motors: motions under limits, and whether the motors suffice for them.

    budget               torque by cause, speed, power, bearing loads and headroom of each joint (MotorBudget)
    read_motors          limits of motors from a CSV file (Motors)
    point_to_point       the fastest motion between two states under limits of velocity, acceleration and jerk
    fastest              the path of a motion as fast as the limits of its budget allow
    max_payload          the largest point mass with which the motors of a budget suffice
    path                 a path as fast as the motors allow (PathPlan)

Each motion is a `rd.control.Plan`, whose reference controllers follow.
robot_dyn/tools/motors/README.md lists the files.
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
