"""Figures of runs and batches.

plots.py    `plot`
parts.py    the parts of a figure of a run, by name; batch.py those of rollouts
sheet.py    panels of cells on a page, with their titles and legends
figure.py   cells: axes with curves, limits and scales; themes and styles
shown.py    the figure that `plot` returns, for notebooks and files
pictures.py kinds of picture files
"""
