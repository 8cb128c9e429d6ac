"""Tests of `robot_dyn.tools.stress`."""
