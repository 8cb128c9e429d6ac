# What this folder offers to tools and tests, and where it lives; modules of the core import each other instead.
from robot_dyn.model import findings as findings
from robot_dyn.model.gravity import gravity_acts as gravity_acts
