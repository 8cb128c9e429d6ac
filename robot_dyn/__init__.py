"""Dynamics of robot arms from a URDF: M(q) a + C(q, v) v + N(t, q, v) = Υ, by Pinocchio and a Lagrangian."""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # as of typing, whose import takes longer than all of this
if TYPE_CHECKING:
    from typing import Any

    from robot_dyn.accuracy.advisor import Advice as Advice
    from robot_dyn.accuracy.advisor import advise as advise
    from robot_dyn.accuracy.certificate import Certificate as Certificate
    from robot_dyn.accuracy.certify import certify as certify
    from robot_dyn.accuracy.compare import Comparison as Comparison
    from robot_dyn.accuracy.compare import compare as compare
    from robot_dyn.accuracy.cost import Cost as Cost
    from robot_dyn.accuracy.cost import cost as cost
    from robot_dyn.accuracy.save import save_result as save_result
    from robot_dyn.accuracy.work_precision import WorkPrecision as WorkPrecision
    from robot_dyn.accuracy.work_precision import work_precision as work_precision
    from robot_dyn.arithmetic import Ball as Ball
    from robot_dyn.arithmetic import midpoint as midpoint
    from robot_dyn.arithmetic import radius as radius
    from robot_dyn.coefficients import coefficient as coefficient
    from robot_dyn.compiled.plant import Compiled as Compiled
    from robot_dyn.control.block import Block as Block
    from robot_dyn.control.cartesian import circle as circle
    from robot_dyn.control.cartesian import line as line
    from robot_dyn.control.computed_torque import ComputedTorque as ComputedTorque
    from robot_dyn.control.computed_torque import FeedForward as FeedForward
    from robot_dyn.control.computed_torque import PDGravity as PDGravity
    from robot_dyn.control.controller import Controller as Controller
    from robot_dyn.control.controller import Stateless as Stateless
    from robot_dyn.control.differences import Differences as Differences
    from robot_dyn.control.independent_joint import PD as PD
    from robot_dyn.control.independent_joint import PID as PID
    from robot_dyn.control.independent_joint import gains_from as gains_from
    from robot_dyn.control.loop import Loop as Loop
    from robot_dyn.control.low_pass import LowPass as LowPass
    from robot_dyn.control.multirate import Multirate as Multirate
    from robot_dyn.control.noise import Noise as Noise
    from robot_dyn.control.operational_space import OperationalSpace as OperationalSpace
    from robot_dyn.control.operational_space import task_dynamics as task_dynamics
    from robot_dyn.control.quantisation import Quantisation as Quantisation
    from robot_dyn.control.rate_limit import RateLimit as RateLimit
    from robot_dyn.control.reference import PiecewisePolynomial as PiecewisePolynomial
    from robot_dyn.control.reference import hold as hold
    from robot_dyn.control.reference import quintic as quintic
    from robot_dyn.control.reference import via_points as via_points
    from robot_dyn.control.samples import Samples as Samples
    from robot_dyn.doctor.check import Checkup as Checkup
    from robot_dyn.doctor.check import check as check
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
    from robot_dyn.effects.effect import Stateful as Stateful
    from robot_dyn.effects.friction import RegularisedCoulombFriction as RegularisedCoulombFriction
    from robot_dyn.effects.friction import ViscousFriction as ViscousFriction
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
    from robot_dyn.effects.spring import Spring as Spring
    from robot_dyn.effects.wrench import ExternalWrench as ExternalWrench
    from robot_dyn.errors import ModelWarning as ModelWarning
    from robot_dyn.errors import PrecisionWarning as PrecisionWarning
    from robot_dyn.errors import RobotDynError as RobotDynError
    from robot_dyn.integrate.adaptive import Adaptive as Adaptive
    from robot_dyn.integrate.methods import method as method
    from robot_dyn.lagrange.euler_lagrange import euler_lagrange as euler_lagrange
    from robot_dyn.lagrange.manipulator import Lagrangian as Lagrangian
    from robot_dyn.model.catalog import list_robots as list_robots
    from robot_dyn.model.dynamics import Dynamics as Dynamics
    from robot_dyn.model.edits import STANDARD_GRAVITY as STANDARD_GRAVITY
    from robot_dyn.model.edits import Payload as Payload
    from robot_dyn.model.loading import load as load
    from robot_dyn.model.robot import Robot as Robot
    from robot_dyn.proof.prove import prove as prove
    from robot_dyn.proof.theorem import Proof as Proof
    from robot_dyn.scene.scene import read_scene as read_scene
    from robot_dyn.simulation.event import Event as Event
    from robot_dyn.simulation.linearise import linearise as linearise
    from robot_dyn.simulation.rollout import rollouts as rollouts
    from robot_dyn.simulation.rollout_result import Rollouts as Rollouts
    from robot_dyn.simulation.rollouts_file import load_rollouts as load_rollouts
    from robot_dyn.simulation.rollouts_file import save_rollouts as save_rollouts
    from robot_dyn.simulation.run_file import load_run as load_run
    from robot_dyn.simulation.run_file import save_run as save_run
    from robot_dyn.simulation.setup import Setup as Setup
    from robot_dyn.simulation.simulate import simulate as simulate
    from robot_dyn.simulation.table import export_csv as export_csv
    from robot_dyn.simulation.trajectory import Trajectory as Trajectory
    from robot_dyn.stress_test.result import Stress as Stress
    from robot_dyn.stress_test.stress import stress as stress
    from robot_dyn.threshold import Threshold as Threshold
    from robot_dyn.view.plots import plot as plot
    from robot_dyn.view.plots import save_plot as save_plot
    from robot_dyn.view.replay import replay as replay
    from robot_dyn.view.replay import save_replay as save_replay
    from robot_dyn.view.replay import save_show as save_show
    from robot_dyn.view.replay import show as show

# Public names and where they live; imported when first used, so that `import robot_dyn` stays light (PEP 562).
_HOME = {
    "Active": "effects.effect",
    "ActuatorLag": "effects.actuator",
    "Adaptive": "integrate.adaptive",
    "Advice": "accuracy.advisor",
    "Ball": "arithmetic",
    "Block": "control.block",
    "Bound": "effects.effect",
    "CarriedPayload": "effects.carried_payload",
    "Certificate": "accuracy.certificate",
    "Checkup": "doctor.check",
    "Comparison": "accuracy.compare",
    "Compiled": "compiled.plant",
    "ComputedTorque": "control.computed_torque",
    "Conservative": "effects.effect",
    "Controller": "control.controller",
    "Cost": "accuracy.cost",
    "DahlFriction": "effects.dahl",
    "Differences": "control.differences",
    "Dissipative": "effects.effect",
    "Drive": "effects.effect",
    "DryFriction": "effects.dry_friction",
    "Dynamics": "model.dynamics",
    "EffortLimit": "effects.actuator",
    "Event": "simulation.event",
    "ExternalWrench": "effects.wrench",
    "FeedForward": "control.computed_torque",
    "JointStopDamper": "effects.joint_limit",
    "JointStopSpring": "effects.joint_limit",
    "Lagrangian": "lagrange.manipulator",
    "LineDamper": "effects.line_spring_damper",
    "LineSpring": "effects.line_spring_damper",
    "LineSpringDamper": "effects.line_spring_damper",
    "Loop": "control.loop",
    "LowPass": "control.low_pass",
    "LuGreFriction": "effects.lugre",
    "ModelWarning": "errors",
    "Multirate": "control.multirate",
    "Noise": "control.noise",
    "OperationalSpace": "control.operational_space",
    "PD": "control.independent_joint",
    "PDGravity": "control.computed_torque",
    "PID": "control.independent_joint",
    "Payload": "model.edits",
    "PiecewisePolynomial": "control.reference",
    "Plant": "effects.plant",
    "PrecisionWarning": "errors",
    "Proof": "proof.theorem",
    "Quantisation": "control.quantisation",
    "RateLimit": "control.rate_limit",
    "RegularisedCoulombFriction": "effects.friction",
    "RigidBacklash": "effects.rigid_backlash",
    "RigidStops": "effects.rigid_stops",
    "Robot": "model.robot",
    "RobotDynError": "errors",
    "Rollouts": "simulation.rollout_result",
    "STANDARD_GRAVITY": "model.edits",
    "Samples": "control.samples",
    "SeriesElastic": "effects.series_elastic",
    "Setup": "simulation.setup",
    "Spring": "effects.spring",
    "Stateful": "effects.effect",
    "Stateless": "control.controller",
    "Stress": "stress_test.result",
    "Threshold": "threshold",
    "Trajectory": "simulation.trajectory",
    "ViscousFriction": "effects.friction",
    "WorkPrecision": "accuracy.work_precision",
    "advise": "accuracy.advisor",
    "certify": "accuracy.certify",
    "check": "doctor.check",
    "circle": "control.cartesian",
    "coefficient": "coefficients",
    "compare": "accuracy.compare",
    "cost": "accuracy.cost",
    "euler_lagrange": "lagrange.euler_lagrange",
    "export_csv": "simulation.table",
    "gains_from": "control.independent_joint",
    "hold": "control.reference",
    "joint_stops": "effects.joint_limit",
    "line": "control.cartesian",
    "linearise": "simulation.linearise",
    "list_robots": "model.catalog",
    "load": "model.loading",
    "load_rollouts": "simulation.rollouts_file",
    "load_run": "simulation.run_file",
    "method": "integrate.methods",
    "midpoint": "arithmetic",
    "plot": "view.plots",
    "prove": "proof.prove",
    "quintic": "control.reference",
    "radius": "arithmetic",
    "read_scene": "scene.scene",
    "replay": "view.replay",
    "rollouts": "simulation.rollout",
    "save_plot": "view.plots",
    "save_replay": "view.replay",
    "save_result": "accuracy.save",
    "save_rollouts": "simulation.rollouts_file",
    "save_run": "simulation.run_file",
    "save_show": "view.replay",
    "show": "view.replay",
    "simulate": "simulation.simulate",
    "stress": "stress_test.stress",
    "task_dynamics": "control.operational_space",
    "via_points": "control.reference",
    "work_precision": "accuracy.work_precision",
}

_FORMER = {"Memoryless": "Stateless"}

__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("robot-dyn")
    if name in _FORMER:
        from robot_dyn.former import tell

        tell(f"robot_dyn.{name}", _FORMER[name], up=2)
        name = _FORMER[name]
    if name not in _HOME:
        raise AttributeError(f"module 'robot_dyn' has no attribute {name!r}")
    return getattr(import_module(f"robot_dyn.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
