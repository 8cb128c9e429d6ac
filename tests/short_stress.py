"""A stress test of little work, by a clock of its own."""

from __future__ import annotations

from itertools import count

import robot_dyn as rd
from robot_dyn.tools.stress import stressed


def short_stress(robot: rd.Robot, looks: int = 1000, runs: int = 0, seed: int = 0) -> rd.tools.stress.Stress:
    """So much as is done until the clock, which goes a second further at each look, was looked at so often."""
    clock = count()
    return stressed(robot, 100, runs, seed, looks, None, lambda: float(next(clock)))
