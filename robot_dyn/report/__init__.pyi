# Names that tools and tests import of this folder, and where they live; modules of the core import modules.
from robot_dyn.report.environment import processor_and_versions as processor_and_versions
from robot_dyn.report.figure import PAGE as PAGE
from robot_dyn.report.figure import Colours as Colours
from robot_dyn.report.figure import ResultError as ResultError
from robot_dyn.report.figure import ink as ink
from robot_dyn.report.figure import key as key
from robot_dyn.report.figure import legend as legend
from robot_dyn.report.figure import sheet as sheet
from robot_dyn.report.figure import styled as styled
from robot_dyn.report.result import INTERRUPTED as INTERRUPTED
from robot_dyn.report.result import JSON as JSON
from robot_dyn.report.result import Result as Result
from robot_dyn.report.time_budget import Budget as Budget
from robot_dyn.report.time_budget import OvertimeError as OvertimeError
