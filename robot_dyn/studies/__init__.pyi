# The public names of this room and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.arithmetic import Ball as Ball
from robot_dyn.arithmetic import midpoint as midpoint
from robot_dyn.arithmetic import radius as radius
from robot_dyn.cross_check.compare import Comparison as Comparison
from robot_dyn.studies.advice import Advice as Advice
from robot_dyn.studies.certificate.certificate import Certificate as Certificate
from robot_dyn.studies.certificate.certify import certify as certify
from robot_dyn.studies.costs.cost import Cost as Cost
from robot_dyn.studies.costs.cost import cost as cost
from robot_dyn.studies.doctor.check import Checkup as Checkup
from robot_dyn.studies.motor_budget.result import MotorBudget as MotorBudget
from robot_dyn.studies.proof.prove import prove as prove
from robot_dyn.studies.proof.theorem import Proof as Proof
from robot_dyn.studies.run_difference import RunDifference as RunDifference
from robot_dyn.studies.save import save_result as save_result
from robot_dyn.studies.stress_test.result import Stress as Stress
from robot_dyn.studies.stress_test.stress import stress as stress
from robot_dyn.studies.work_precision_diagram.work_precision import WorkPrecision as WorkPrecision
from robot_dyn.studies.work_precision_diagram.work_precision import work_precision as work_precision

__all__: list[str]
