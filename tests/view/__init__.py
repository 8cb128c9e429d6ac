"""Tests of `robot_dyn.view`."""
