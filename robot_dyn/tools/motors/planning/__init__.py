"""Motions under limits.

jerk_limited      point_to_point: under limits of velocity, acceleration and jerk
path_at_limits    path: as fast as the limits allow; path_plan: judged, and which limit binds when
geometric_path    q(s), and q(s(t)) in pieces; time_scaling: the speed along it, by toppra
plannable         effects and limits that are refused
"""
