# The public names of this tool and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.tools.symbols.equations import SymbolicEquations as SymbolicEquations
from robot_dyn.tools.symbols.equations import symbols as symbols
from robot_dyn.tools.symbols.letters import Meaning as Meaning
from robot_dyn.tools.symbols.letters import RoundedAngle as RoundedAngle

__all__: list[str]

# Names that tests import of this folder.
from robot_dyn.tools.symbols.latex import align as align
from robot_dyn.tools.symbols.letters import Lettering as Lettering
from robot_dyn.tools.symbols.letters import body_numbers as body_numbers
from robot_dyn.tools.symbols.letters import readable as readable
from robot_dyn.tools.symbols.polynomials import Component as Component
