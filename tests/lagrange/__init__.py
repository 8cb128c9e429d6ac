"""Tests of `robot_dyn.lagrange`."""
