"""Tests of `robot_dyn.tools.doctor`."""
