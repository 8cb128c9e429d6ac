"""Tests of `robot_dyn.accuracy`."""
