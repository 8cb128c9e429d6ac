"""Tests of `robot_dyn.plan`."""
