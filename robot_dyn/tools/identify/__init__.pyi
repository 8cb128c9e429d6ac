# The public names of this tool and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.tools.identify.carried import PayloadEstimate as PayloadEstimate
from robot_dyn.tools.identify.carried import payload as payload
from robot_dyn.tools.identify.discrimination import Experiment as Experiment
from robot_dyn.tools.identify.excitation import Excitation as Excitation
from robot_dyn.tools.identify.excitation import excite as excite
from robot_dyn.tools.identify.identification import identify as identify
from robot_dyn.tools.identify.information import ExpectedPrecision as ExpectedPrecision
from robot_dyn.tools.identify.log import LogError as LogError
from robot_dyn.tools.identify.rest_poses import Poses as Poses
from robot_dyn.tools.identify.rest_poses import StaticEstimate as StaticEstimate
from robot_dyn.tools.identify.rest_poses import static as static
from robot_dyn.tools.identify.result import HeldOut as HeldOut
from robot_dyn.tools.identify.result import Identification as Identification
from robot_dyn.tools.identify.result import Parameter as Parameter
from robot_dyn.tools.identify.verdict import Cause as Cause
from robot_dyn.tools.identify.verdict import Verdict as Verdict

__all__: list[str]

# Names that only tools and tests import.
from robot_dyn.tools.identify.discrimination import DECISIVE as DECISIVE
from robot_dyn.tools.identify.discrimination import experiment_of as experiment_of
from robot_dyn.tools.identify.estimation import Estimate as Estimate
from robot_dyn.tools.identify.estimation import Model as Model
from robot_dyn.tools.identify.estimation import estimate as estimate
from robot_dyn.tools.identify.estimation import model_of as model_of
from robot_dyn.tools.identify.fourier_series import FourierSeries as FourierSeries
from robot_dyn.tools.identify.information import Information as Information
from robot_dyn.tools.identify.information import gram as gram
from robot_dyn.tools.identify.log import Log as Log
from robot_dyn.tools.identify.log import read_log as read_log
from robot_dyn.tools.identify.physical import MARGIN as MARGIN
from robot_dyn.tools.identify.physical import distance as distance
from robot_dyn.tools.identify.physical import links_of as links_of
from robot_dyn.tools.identify.physical import nearest_bodies as nearest_bodies
from robot_dyn.tools.identify.physical import nearest_possible as nearest_possible
from robot_dyn.tools.identify.physical import pseudo_inertia as pseudo_inertia
from robot_dyn.tools.identify.physical import whitening as whitening
from robot_dyn.tools.identify.regression import Fit as Fit
from robot_dyn.tools.identify.regression import Rows as Rows
from robot_dyn.tools.identify.regression import fit as fit
from robot_dyn.tools.identify.signals import Signals as Signals
from robot_dyn.tools.identify.signals import low_pass as low_pass
