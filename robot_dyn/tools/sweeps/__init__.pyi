# The public names of this room and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.foundations.errors import SweepError as SweepError
from robot_dyn.tools.sweeps.distributions import choice as choice
from robot_dyn.tools.sweeps.distributions import lognormal as lognormal
from robot_dyn.tools.sweeps.distributions import normal as normal
from robot_dyn.tools.sweeps.distributions import triangular as triangular
from robot_dyn.tools.sweeps.distributions import uniform as uniform
from robot_dyn.tools.sweeps.figures import Run as Run
from robot_dyn.tools.sweeps.figures import final as final
from robot_dyn.tools.sweeps.figures import peak as peak
from robot_dyn.tools.sweeps.figures import rms_tracking_error as rms_tracking_error
from robot_dyn.tools.sweeps.kept_samples import samples as samples
from robot_dyn.tools.sweeps.result import SweepResult as SweepResult
from robot_dyn.tools.sweeps.run_sweep import read_sweep as read_sweep
from robot_dyn.tools.sweeps.run_sweep import run as run
from robot_dyn.tools.sweeps.sensitivity import Sensitivity as Sensitivity
from robot_dyn.tools.sweeps.statistics import Estimate as Estimate
from robot_dyn.tools.sweeps.sweep import Sweep as Sweep
from robot_dyn.tools.sweeps.sweep import from_scene as from_scene

__all__: list[str]

# Names that only tools and tests import.
from robot_dyn.tools.sweeps.run_sweep import begun as begun
from robot_dyn.tools.sweeps.work import Work as Work
