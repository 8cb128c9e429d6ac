"""Tests of `robot_dyn.tools.symbols`."""
