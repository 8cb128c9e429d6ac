# The public names of this tool and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.tools.motors.motor_budget.budget import budget as budget
from robot_dyn.tools.motors.motor_budget.fastest import fastest as fastest
from robot_dyn.tools.motors.motor_budget.largest_payload import max_payload as max_payload
from robot_dyn.tools.motors.motor_budget.result import MotorBudget as MotorBudget
from robot_dyn.tools.motors.motors_file import Motors as Motors
from robot_dyn.tools.motors.motors_file import read_motors as read_motors
from robot_dyn.tools.motors.planning.jerk_limited import point_to_point as point_to_point
from robot_dyn.tools.motors.planning.path_at_limits import path as path
from robot_dyn.tools.motors.planning.path_plan import PathPlan as PathPlan

__all__: list[str]
