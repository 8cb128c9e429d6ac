"""A stress test of little work, by a clock of its own."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import count
from unittest.mock import patch

import robot_dyn as rd
from robot_dyn.report import Budget


def short_stress(
    robot: rd.Robot, looks: int = 1000, runs: int = 0, seed: int = 0, clock: Callable[[], float] | None = None
) -> rd.tools.stress.Stress:
    """So much as is done until the clock, which goes a second further at each look, was looked at so often."""
    ticks = count()
    by_clock = partial(Budget, clock=clock or (lambda: float(next(ticks))))
    with patch("robot_dyn.tools.stress.search.Budget", by_clock):
        return rd.tools.stress.stress(robot, samples=100, runs=runs, seed=seed, budget_s=looks)
