"""Instructions and times of effects, control and algorithms on one arm.

cost           the study and its result
step_cost      a step with each part on and off
query_cost     alternative algorithms for one query
ab_comparison  two versions, timed in turns
diagram        the figure
"""
