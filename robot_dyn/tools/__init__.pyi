# The tools: type checkers read this file, and __init__.py does.
from robot_dyn.tools import doctor as doctor
from robot_dyn.tools import export as export
from robot_dyn.tools import identify as identify
from robot_dyn.tools import motors as motors
from robot_dyn.tools import proof as proof
from robot_dyn.tools import step as step
from robot_dyn.tools import stress as stress
from robot_dyn.tools import sweeps as sweeps
from robot_dyn.tools import symbols as symbols

__all__: list[str]
