"""Figures of a run: plots.py says what is drawn against what, figure.py draws it."""
