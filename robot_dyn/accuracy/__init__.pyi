# The public names of this room and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.accuracy.advice import Advice as Advice
from robot_dyn.accuracy.certificate.certify import Certificate as Certificate
from robot_dyn.accuracy.certificate.certify import certify as certify
from robot_dyn.accuracy.correct_digits import digits as digits
from robot_dyn.accuracy.correct_digits import warn_below as warn_below
from robot_dyn.accuracy.costs.cost import Cost as Cost
from robot_dyn.accuracy.costs.cost import cost as cost
from robot_dyn.accuracy.run_difference import RunDifference as RunDifference
from robot_dyn.accuracy.work_precision_diagram.work_precision import WorkPrecision as WorkPrecision
from robot_dyn.accuracy.work_precision_diagram.work_precision import work_precision as work_precision
from robot_dyn.cross_check.compare import Comparison as Comparison
from robot_dyn.foundations.arithmetic import Ball as Ball
from robot_dyn.foundations.arithmetic import midpoint as midpoint
from robot_dyn.foundations.arithmetic import radius as radius

__all__: list[str]

# Names that only tools and tests import.
from robot_dyn.accuracy.advice import advice_about as advice_about
from robot_dyn.accuracy.advice import at_rest as at_rest
from robot_dyn.accuracy.certificate.digit_count import DigitCount as DigitCount
from robot_dyn.accuracy.certificate.digit_count import Implementation as Implementation
from robot_dyn.accuracy.certificate.digit_count import evaluate as evaluate
from robot_dyn.accuracy.certificate.digit_count import implementations as implementations
from robot_dyn.accuracy.certificate.worst_case_search import Batch as Batch
from robot_dyn.accuracy.certificate.worst_case_search import random_states as random_states
from robot_dyn.accuracy.certificate.worst_case_search import worst_state as worst_state
from robot_dyn.accuracy.correct_digits import digits_of as digits_of
from robot_dyn.accuracy.work_precision_diagram.peers.arm_motion import ArmMotion as ArmMotion
from robot_dyn.accuracy.work_precision_diagram.peers.arm_motion import PeerError as PeerError
from robot_dyn.accuracy.work_precision_diagram.peers.arm_motion import bare_urdf as bare_urdf
from robot_dyn.accuracy.work_precision_diagram.peers.arm_motion import desired_motion as desired_motion
from robot_dyn.accuracy.work_precision_diagram.peers.mujoco import mujoco_model as mujoco_model
