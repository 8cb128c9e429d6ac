# What this folder offers to tools and tests, and where it lives; modules of the core import each other instead.
from robot_dyn.cross_check.compare import random_state as random_state
