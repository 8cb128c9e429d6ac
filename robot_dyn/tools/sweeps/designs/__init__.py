"""Designs of experiments: row i of numbers in [0, 1) is computed from i alone, at equal cost for every i.

base                    what all designs have in common: `Design`, counts that one cannot take
by_name                 `design(name, runs, dimensions, seed)`
random_rows             independent numbers: Philox, whose counter is the row
sobol, halton, latin    16 independent scramblings, each of a sixteenth of the rows
saltelli                A, B and AB_i on Sobol' rows, for sensitivity indices
grid, table             points that are not random: all combinations of levels; rows of a table
"""

from robot_dyn.tools.sweeps.designs.base import Design
from robot_dyn.tools.sweeps.designs.by_name import design

__all__ = ["Design", "design"]
