"""Tests of `robot_dyn.integrate`."""
