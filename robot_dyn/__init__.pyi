# The public names and where they live: type checkers read this file, and public_names does.
from robot_dyn import accuracy as accuracy
from robot_dyn import control as control
from robot_dyn import effects as effects
from robot_dyn import integrate as integrate
from robot_dyn import tools as tools
from robot_dyn.accuracy.advice import advise as advise
from robot_dyn.accuracy.run_difference import diff_runs as diff_runs
from robot_dyn.codegen.plant import compiled as compiled
from robot_dyn.cross_check.compare import compare as compare
from robot_dyn.description.catalog import list_robots as list_robots
from robot_dyn.description.edits import STANDARD_GRAVITY as STANDARD_GRAVITY
from robot_dyn.description.edits import Payload as Payload
from robot_dyn.effects.plant import Plant as Plant
from robot_dyn.effects.why import why as why
from robot_dyn.foundations.errors import ModelWarning as ModelWarning
from robot_dyn.foundations.errors import PrecisionWarning as PrecisionWarning
from robot_dyn.foundations.errors import RobotDynError as RobotDynError
from robot_dyn.lagrange.euler_lagrange import euler_lagrange as euler_lagrange
from robot_dyn.lagrange.lagrangian import Lagrangian as Lagrangian
from robot_dyn.model.loading import load as load
from robot_dyn.model.robot import Robot as Robot
from robot_dyn.model.robot import info as info
from robot_dyn.scene.explain import explain as explain
from robot_dyn.scene.scene import read_scene as read_scene
from robot_dyn.simulation.dynamics.event import Event as Event
from robot_dyn.simulation.dynamics.linearise import linearise as linearise
from robot_dyn.simulation.results.trajectory import Trajectory as Trajectory
from robot_dyn.simulation.rollouts.parameters import parameters as parameters
from robot_dyn.simulation.rollouts.read import read as read
from robot_dyn.simulation.rollouts.result import Rollouts as Rollouts
from robot_dyn.simulation.rollouts.rollouts import rollouts as rollouts
from robot_dyn.simulation.setup.setup import Setup as Setup
from robot_dyn.simulation.simulate import simulate as simulate
from robot_dyn.view.plots.plots import plot as plot
from robot_dyn.view.replay import replay as replay
from robot_dyn.view.replay import show as show

__version__: str
__all__: list[str]
