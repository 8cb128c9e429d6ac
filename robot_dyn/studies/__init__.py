"""Studies: what accuracy costs, what breaks first, what can be proven, and what is wrong in a file.

    work_precision     error against time of every method and of other programs (WorkPrecision)
    certify            true digits of M, C, N, inverse and forward dynamics, against balls (Certificate)
    cost               instructions and times of effects, control and algorithms (Cost)
    stress             worst configurations, limits and random runs, each judged (Stress)
    prove              enclosures of q(t) and v(t) (Proof)
    save_result        any of these as figure, CSV or JSON
    Ball               an arithmetic of numbers with a radius; midpoint, radius

Results of functions of `rd`: Comparison (compare), Checkup (check), Advice (advise), MotorBudget (budget),
RunDifference (compare_runs).
robot_dyn/studies/README.md lists its files.
"""

from robot_dyn.public import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
