# The public names of this room and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.control.cartesian import CartesianReference as CartesianReference
from robot_dyn.control.cartesian import circle as circle
from robot_dyn.control.cartesian import line as line
from robot_dyn.control.computed_torque import ComputedTorque as ComputedTorque
from robot_dyn.control.computed_torque import FeedForward as FeedForward
from robot_dyn.control.computed_torque import PDGravity as PDGravity
from robot_dyn.control.contact import AlarmThreshold as AlarmThreshold
from robot_dyn.control.contact import Contact as Contact
from robot_dyn.control.contact import ExternalTorque as ExternalTorque
from robot_dyn.control.controller import ControlLaw as ControlLaw
from robot_dyn.control.controller import Controller as Controller
from robot_dyn.control.controller import Stateless as Stateless
from robot_dyn.control.digital_loop.block import Block as Block
from robot_dyn.control.digital_loop.block import Differences as Differences
from robot_dyn.control.digital_loop.block import Noise as Noise
from robot_dyn.control.digital_loop.block import Quantisation as Quantisation
from robot_dyn.control.digital_loop.block import RateLimit as RateLimit
from robot_dyn.control.digital_loop.loop import Loop as Loop
from robot_dyn.control.digital_loop.low_pass import LowPass as LowPass
from robot_dyn.control.independent_joint import PD as PD
from robot_dyn.control.independent_joint import PID as PID
from robot_dyn.control.independent_joint import gains_from as gains_from
from robot_dyn.control.momentum_observer import MomentumObserver as MomentumObserver
from robot_dyn.control.momentum_observer import external_torque as external_torque
from robot_dyn.control.operational_space import OperationalSpace as OperationalSpace
from robot_dyn.control.operational_space import TaskDynamics as TaskDynamics
from robot_dyn.control.operational_space import task_dynamics as task_dynamics
from robot_dyn.control.orientation import orientation_error as orientation_error
from robot_dyn.control.orientation import rotation_vector as rotation_vector
from robot_dyn.control.plan import Plan as Plan
from robot_dyn.control.pose import InverseKinematics as InverseKinematics
from robot_dyn.control.pose import inverse_kinematics as inverse_kinematics
from robot_dyn.control.reference import PiecewisePolynomial as PiecewisePolynomial
from robot_dyn.control.reference import Reference as Reference
from robot_dyn.control.reference import hold as hold
from robot_dyn.control.reference import quintic as quintic
from robot_dyn.control.reference import via_points as via_points
from robot_dyn.control.samples.measured import from_samples as from_samples
from robot_dyn.control.samples.spline import Samples as Samples

__all__: list[str]

# Names that only tools and tests import.
from robot_dyn.control.extremes import extreme_values as extreme_values
from robot_dyn.control.operational_space import POSE as POSE
from robot_dyn.control.operational_space import POSITION as POSITION
from robot_dyn.control.reference import polynomial as polynomial
from robot_dyn.control.samples.findings import refuse_other_units as refuse_other_units
from robot_dyn.control.samples.recorded import recorded as recorded
from robot_dyn.control.samples.sources import table_of as table_of
from robot_dyn.control.samples.table import name_of as name_of
