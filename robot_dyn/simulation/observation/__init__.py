"""Observations at every step of a run, independent of its record.

- `observation`, `chatter`: extremes, time past levels, and reversals of the actuation, in plain functions for the loops
- `observer`: the columns of one run, and their extremes in windows of time
- `guard_levels`: the levels that a run may pass: effort limits, stops, limits of the file
- `remarks`: kinds of remarks and their lines of text
"""
