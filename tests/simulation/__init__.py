"""Tests of `robot_dyn.simulation`."""
