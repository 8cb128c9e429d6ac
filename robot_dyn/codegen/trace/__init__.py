"""The trace: the formulations of the library run on symbols and become a program.

origins, base_parameters    the same motion with fewer numbers: frames, inertias
symbol, condition, symbolic    numbers of a trace, their comparisons, and both outcomes of a branch
trace             formulations of each quantity, and the shortest one
symbolic_dynamics, symbolic_plant    robots, plants and controllers of symbols
from_casadi       from a CasADi Function to a program
"""
