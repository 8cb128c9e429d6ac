"""Tests of `robot_dyn.model`."""
