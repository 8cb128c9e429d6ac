# The public names of this tool and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.tools.step.stepper import State as State
from robot_dyn.tools.step.stepper import Stepper as Stepper
from robot_dyn.tools.step.vector_env import Env as Env
from robot_dyn.tools.step.vector_env import VectorEnv as VectorEnv

__all__: list[str]
