"""Samples as a motion: read from files, data frames and arrays, joined by a spline, with what is doubtful in them."""
