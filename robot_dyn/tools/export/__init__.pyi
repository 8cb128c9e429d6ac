# The public names of this tool and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.tools.export.function import casadi as casadi
from robot_dyn.tools.export.function import parameter_values as parameter_values
from robot_dyn.tools.export.sampled_model import SampledModel as SampledModel
from robot_dyn.tools.export.sampled_model import discretise as discretise
from robot_dyn.tools.export.source import CFunction as CFunction
from robot_dyn.tools.export.source import CSource as CSource
from robot_dyn.tools.export.source import c_source as c_source

__all__: list[str]
