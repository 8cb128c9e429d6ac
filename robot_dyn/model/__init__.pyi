# Names that tools and tests import of this folder, and where they live; modules of the core import modules.
from robot_dyn.model import findings as findings
from robot_dyn.model.gravity_moments import gravity_bound as gravity_bound
from robot_dyn.model.newton_euler import JointWrenches as JointWrenches
from robot_dyn.model.right_angles import with_exact_right_angles as with_exact_right_angles
