"""Motions under limits.

jerk_limited      point_to_point: under limits of velocity, acceleration and jerk
path_at_limits    the fastest motion along a path; path_plan: which limit binds, and when
geometric_path    q(s), and q(s(t)) in pieces; time_scaling: the speed along it, by toppra
plannable         effects and limits that are refused
"""
