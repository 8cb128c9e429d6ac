"""Tests of `robot_dyn.shapes`."""
