"""Tests of `robot_dyn.description`."""
