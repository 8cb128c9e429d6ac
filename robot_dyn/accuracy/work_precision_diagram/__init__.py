"""Work-precision diagrams: error of a motion against time and evaluations, also of other programs.

work_precision     the study and its result
method_under_test  a method with its ladder of settings, its runs, order, price of an error
measurement        all runs, in turns, within a budget
reference_run      what errors are measured against, the horizon, and what judges beyond it
peers/             SciPy, MuJoCo, Drake, heyoka
diagram            the figure
"""
