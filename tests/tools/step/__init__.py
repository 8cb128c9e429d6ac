"""Tests of `robot_dyn.tools.step`."""
