"""Motions to follow: from samples, between two points under limits, along a path at the limits of the motors.

    inverse_kinematics   joint positions that bring a frame to a pose (InverseKinematics)
    point_to_point       the fastest motion between two states under limits of velocity, acceleration and jerk (Plan)
    path                 a path as fast as the motors allow (PathPlan); read_motors: limits of motors (Motors)
    from_samples         measured or foreign samples as a smooth reference (Plan)

Each motion is a `rd.control.PiecewisePolynomial`, which controllers follow. robot_dyn/plan/README.md lists its files.
"""

from robot_dyn.public import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
