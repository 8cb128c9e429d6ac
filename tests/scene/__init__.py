"""Tests of `robot_dyn.scene`."""
