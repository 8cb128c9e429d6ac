# The public names of this room and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.plan.jerk_limited import point_to_point as point_to_point
from robot_dyn.plan.motors import Motors as Motors
from robot_dyn.plan.motors import read_motors as read_motors
from robot_dyn.plan.path_at_limits import path as path
from robot_dyn.plan.path_plan import PathPlan as PathPlan
from robot_dyn.plan.plan import Plan as Plan
from robot_dyn.plan.pose import InverseKinematics as InverseKinematics
from robot_dyn.plan.pose import inverse_kinematics as inverse_kinematics
from robot_dyn.plan.samples.measured import from_samples as from_samples

__all__: list[str]
