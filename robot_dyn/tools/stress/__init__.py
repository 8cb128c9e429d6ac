"""Stress tests: worst configurations, limits that runs confirm, and runs judged against better ones.

    stress   the first limits that an arm reaches (Stress)

search       the parts of a stress test, in sequence
work         pieces of work within a time limit
worst        worst configurations, and states of few digits
limits       limits of step, gain, speed and payload, confirmed by runs
runs         random scenes, and their runs judged
result       the result, and its text
command      the command `stress`
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
