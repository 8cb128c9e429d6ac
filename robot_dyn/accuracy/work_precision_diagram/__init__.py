"""Work-precision diagrams: error of a motion against time and evaluations, also of other programs.

work_precision     the study and its result
method_under_test  a method with its ladder of settings; its runs
measurement        all runs, in turns, within a budget
tolerance_ladder   the measured runs of a method: order, price of an error
reference_run      what errors are measured against, and the horizon
past_horizon       energy and return where no error can be measured
peers/             SciPy, MuJoCo, Drake, heyoka
diagram            the figure
"""
