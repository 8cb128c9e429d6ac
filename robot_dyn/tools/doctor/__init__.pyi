# The public names of this tool and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.tools.doctor.checkup import Checkup as Checkup
from robot_dyn.tools.doctor.checkup import check_urdf as check_urdf
from robot_dyn.tools.doctor.robot_difference import RobotDifference as RobotDifference
from robot_dyn.tools.doctor.robot_difference import diff_robots as diff_robots

__all__: list[str]

# Names that only tools and tests import.
from robot_dyn.tools.doctor.checkup import checked as checked
from robot_dyn.tools.doctor.coordinate_map import Basis as Basis
from robot_dyn.tools.doctor.coordinate_map import Obstacle as Obstacle
from robot_dyn.tools.doctor.document import Document as Document
from robot_dyn.tools.doctor.finding import Severity as Severity
