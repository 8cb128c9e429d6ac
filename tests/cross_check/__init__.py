"""Tests of `robot_dyn.cross_check`."""
