"""Tests of `robot_dyn.control`."""
