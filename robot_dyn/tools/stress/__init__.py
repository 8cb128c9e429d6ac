"""Stress tests: worst configurations, limits that runs confirm, and runs judged against better ones.

    stress   the first limits that an arm reaches (Stress)

search       the parts of a stress test, one after the other
work         pieces of work within a time
worst        worst configurations, and states of few digits
lost_digits  digits lost at the worst states
stability    limits of step and gain, confirmed by runs
loads        limits of speed and payload
runs         random scenes, and their runs judged
result       the result, and its text
command      the command `stress`
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
