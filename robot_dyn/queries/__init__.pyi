# Names that tools and tests import of this folder, and where they live; modules of the core import modules.
from robot_dyn.queries.dynamics import CORIOLIS_TORQUE as CORIOLIS_TORQUE
from robot_dyn.queries.dynamics import EQUATION as EQUATION
from robot_dyn.queries.dynamics import FORWARD_DYNAMICS as FORWARD_DYNAMICS
from robot_dyn.queries.dynamics import INVERSE_DYNAMICS as INVERSE_DYNAMICS
from robot_dyn.queries.dynamics import QUANTITIES as QUANTITIES
from robot_dyn.queries.dynamics import C as C
from robot_dyn.queries.dynamics import Dynamics as Dynamics
from robot_dyn.queries.dynamics import M as M
from robot_dyn.queries.dynamics import N as N
from robot_dyn.queries.quantity import Quantity as Quantity
from robot_dyn.queries.units import coefficient_unit as coefficient_unit
from robot_dyn.queries.units import format_duration as format_duration
from robot_dyn.queries.units import joint_types_of as joint_types_of
from robot_dyn.queries.units import joint_units as joint_units
from robot_dyn.queries.units import of_joint as of_joint
from robot_dyn.queries.units import unit as unit
from robot_dyn.queries.units import without_rounding as without_rounding
