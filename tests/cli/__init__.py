"""Tests of `robot_dyn.cli`."""
