"""Tests of `robot_dyn.studies`."""
