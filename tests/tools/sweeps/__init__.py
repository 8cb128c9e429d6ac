"""Tests of `robot_dyn.sweeps`."""
