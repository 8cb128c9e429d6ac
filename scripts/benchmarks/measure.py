"""Measuring: what benchmarks share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from timeit import timeit
from typing import final

import robot_dyn as rd
from robot_dyn.studies.timing import in_turns

BATCH = 4096


@final
@dataclass(frozen=True)
class Effort:
    """How long to measure: repeats of each side, and seconds of a loop."""

    repeats: int = 11
    at_least: float = 0.1

    @property
    def quick(self) -> bool:
        """Whether it is only to be seen that all runs."""
        return self.repeats < 5


def alternate(calls: Mapping[str, Callable[[], object]], effort: Effort) -> dict[str, float]:
    """Median time of each call in µs; the calls take turns."""
    return {name: 1e6 * time for name, time in in_turns(calls, effort.repeats, effort.at_least).items()}


def lowest(calls: Mapping[str, Callable[[], object]], effort: Effort, number: int = 100) -> dict[str, float]:
    """Lowest time of each call in µs over loops of so many, short enough that other processes leave some alone."""
    times = dict.fromkeys(calls, inf)
    for _ in range(40 * effort.repeats):
        for name, call in calls.items():
            times[name] = min(times[name], 1e6 * timeit(call, number=number) / number)
    return times


def arms() -> dict[str, rd.Robot]:
    """The arms of every table."""
    return {"UR5": rd.load("ur5"), "Panda-7": rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})}


def table(*headings: str) -> None:
    """The head of a table; words to the left, numbers to the right."""
    words = ("arm", "query", "bare calls", "C by", "what", "process")
    print("\n| " + " | ".join(headings) + " |")
    print("|" + "|".join("---" if heading in words else "--:" for heading in headings) + "|")


def row(*cells: object) -> None:
    """A row of a table."""
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)
