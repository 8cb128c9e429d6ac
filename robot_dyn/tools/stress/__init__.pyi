# The public names of this tool and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.tools.stress.result import Stress as Stress
from robot_dyn.tools.stress.search import stress as stress

__all__: list[str]
