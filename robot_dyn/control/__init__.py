"""Torque from a reference and a measured state: each controller owns its model of the arm and never sees the plant."""
