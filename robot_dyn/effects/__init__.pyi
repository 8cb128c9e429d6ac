# The public names of this room and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.effects.actuator import ActuatorLag as ActuatorLag
from robot_dyn.effects.actuator import EffortLimit as EffortLimit
from robot_dyn.effects.carried_payload import CarriedPayload as CarriedPayload
from robot_dyn.effects.dahl import DahlFriction as DahlFriction
from robot_dyn.effects.dry_friction import DryFriction as DryFriction
from robot_dyn.effects.effect import Active as Active
from robot_dyn.effects.effect import Bound as Bound
from robot_dyn.effects.effect import Conservative as Conservative
from robot_dyn.effects.effect import Dissipative as Dissipative
from robot_dyn.effects.effect import Drive as Drive
from robot_dyn.effects.effect import Effect as Effect
from robot_dyn.effects.effect import Force as Force
from robot_dyn.effects.effect import Stateful as Stateful
from robot_dyn.effects.equation_of_motion import EquationOfMotion as EquationOfMotion
from robot_dyn.effects.friction import RegularisedCoulombFriction as RegularisedCoulombFriction
from robot_dyn.effects.friction import ViscousFriction as ViscousFriction
from robot_dyn.effects.hold import HeldJoint as HeldJoint
from robot_dyn.effects.joint_limit import JointStopDamper as JointStopDamper
from robot_dyn.effects.joint_limit import JointStopSpring as JointStopSpring
from robot_dyn.effects.joint_limit import joint_stops as joint_stops
from robot_dyn.effects.line_spring_damper import LineDamper as LineDamper
from robot_dyn.effects.line_spring_damper import LineSpring as LineSpring
from robot_dyn.effects.line_spring_damper import LineSpringDamper as LineSpringDamper
from robot_dyn.effects.lugre import LuGreFriction as LuGreFriction
from robot_dyn.effects.plant import Plant as Plant
from robot_dyn.effects.rigid_backlash import RigidBacklash as RigidBacklash
from robot_dyn.effects.rigid_stops import RigidStops as RigidStops
from robot_dyn.effects.series_elastic import SeriesElastic as SeriesElastic
from robot_dyn.effects.set_valued import Interval as Interval
from robot_dyn.effects.set_valued import Mode as Mode
from robot_dyn.effects.set_valued import SetValued as SetValued
from robot_dyn.effects.spring import Spring as Spring
from robot_dyn.effects.torque_speed_limit import TorqueSpeedLimit as TorqueSpeedLimit
from robot_dyn.effects.wrench import ExternalWrench as ExternalWrench
from robot_dyn.foundations.coefficients import coefficient as coefficient
from robot_dyn.foundations.threshold import Layer as Layer
from robot_dyn.foundations.threshold import Threshold as Threshold
from robot_dyn.queries.dynamics import Dynamics as Dynamics

__all__: list[str]

# Names that only tools and tests import.
from robot_dyn.effects.causes import Causes as Causes
from robot_dyn.effects.causes import exerted_torques as exerted_torques
from robot_dyn.effects.causes import torques_by_cause as torques_by_cause
from robot_dyn.effects.effect import numbered as numbered
from robot_dyn.effects.torque_speed import Points as Points
from robot_dyn.effects.torque_speed import TorqueSpeed as TorqueSpeed
from robot_dyn.effects.torque_speed import check_line as check_line
from robot_dyn.effects.torque_speed_limit import AT as AT
from robot_dyn.effects.torque_speed_limit import check_speed as check_speed
