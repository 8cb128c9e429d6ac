"""Work-precision diagrams: error of a motion against time and evaluations, also of other programs.

work_precision     the study and its result
method_under_test  a method with its ladder of settings, its runs, order, price of an error
measurement        all runs, in turns, within a budget
reference_run      the reference solution, its horizon, and checks past the horizon
peers/             SciPy, MuJoCo, Drake, heyoka
diagram            the figure
"""
