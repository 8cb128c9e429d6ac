"""Faults planted in simulated logs: the verdict names them, and none on clean logs."""
