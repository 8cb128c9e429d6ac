"""Stress tests: worst configurations, limits that runs confirm, and runs judged against better ones.

    stress   the first limits that an arm reaches (Stress)

search, result, finding  the search, its result, and its findings
work, shrink             pieces of work within a time; states of few digits
worst, lost_digits       worst configurations; digits lost at the worst states
steps, gains, loads      limits of step, gain, speed and payload
confirm                  runs on both sides of a limit
scenes, runs             random scenes, and their runs judged
text                     its text
command                  the command `stress`
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
