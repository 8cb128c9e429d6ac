"""Comparison of two runs: their difference, the time at which they part, and the settings that differ."""
