# The public names of this room and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.integrate.adaptive import Adaptive as Adaptive
from robot_dyn.integrate.adaptive import Solution as Solution
from robot_dyn.integrate.controlled_steps import Status as Status
from robot_dyn.integrate.explicit import ExplicitRungeKutta as ExplicitRungeKutta
from robot_dyn.integrate.explicit import SemiImplicitEuler as SemiImplicitEuler
from robot_dyn.integrate.gauss import GaussLegendre as GaussLegendre
from robot_dyn.integrate.integrator import FixedStepper as FixedStepper
from robot_dyn.integrate.integrator import IntegrationError as IntegrationError
from robot_dyn.integrate.integrator import Integrator as Integrator
from robot_dyn.integrate.integrator import PlainMethod as PlainMethod
from robot_dyn.integrate.integrator import RightSide as RightSide
from robot_dyn.integrate.integrator import System as System
from robot_dyn.integrate.methods import method as method
from robot_dyn.integrate.rosenbrock import Rosenbrock as Rosenbrock
from robot_dyn.integrate.rosenbrock_table import RosenbrockTable as RosenbrockTable
from robot_dyn.integrate.tableau import ButcherTableau as ButcherTableau
from robot_dyn.integrate.tableau import Surd as Surd
from robot_dyn.integrate.time_stepping import MoreauJean as MoreauJean

__all__: list[str]

# Names that only tools and tests import.
from robot_dyn.integrate.methods import FIXED_STEP as FIXED_STEP
from robot_dyn.integrate.methods import METHODS as METHODS
