"""Tests of `robot_dyn.tools.sweeps`."""
