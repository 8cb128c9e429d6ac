"""Tests of `robot_dyn.tools.motors`."""
