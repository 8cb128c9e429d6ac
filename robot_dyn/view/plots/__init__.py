"""Figures of runs and batches.

plots.py    `plot`
parts.py    what a figure of a run shows, by name; batch.py that of rollouts
sheet.py    panels of cells on a page, with their titles and legends
figure.py   cells: axes with curves, limits and scales; themes and styles
shown.py    the figure that `plot` returns: shown by a notebook, saved by `save`
pictures.py kinds of picture files
"""
