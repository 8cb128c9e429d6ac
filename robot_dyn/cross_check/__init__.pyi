# Names that tools and tests import of this folder, and where they live; modules of the core import modules.
from robot_dyn.cross_check.compare import random_state as random_state
