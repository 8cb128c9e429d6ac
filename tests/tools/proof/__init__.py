"""Tests of `robot_dyn.tools.proof`."""
