"""Accuracy: its cost in time, the number of true digits, and the difference of two runs.

    work_precision     error against time of every method and of other programs (WorkPrecision)
    certify            true digits of M, C, N, inverse and forward dynamics, against balls (Certificate)
    digits             correct digits of one answer; warn_below: a robot whose queries warn of too few
    cost               instructions and times of effects, control and algorithms (Cost)
    Ball               an arithmetic of numbers with a radius; midpoint, radius

`.save(path)` of a result writes its figure, CSV or JSON.
Results of functions of `rd`: Comparison (compare), Advice (advise), RunDifference (diff_runs).
robot_dyn/accuracy/README.md lists its files.
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
