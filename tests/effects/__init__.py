"""Tests of `robot_dyn.effects`."""
