"""Tests of `robot_dyn.tools.export`."""
