"""Measuring: median times of calls that take turns, so that the machine's moods meet all sides."""

from __future__ import annotations

import timeit
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from statistics import median
from typing import final

import robot_dyn as rd

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


def seconds(call: Callable[[], object], at_least: float) -> float:
    """Time of one call, over a loop of about `at_least` seconds."""
    timer, number = timeit.Timer(call), 1
    while (taken := timer.timeit(number)) < at_least:
        number = max(2 * number, int(1.2 * number * at_least / max(taken, 1e-9)))
    return taken / number


def alternate(calls: Mapping[str, Callable[[], object]], effort: Effort) -> dict[str, float]:
    """Median time of each call in µs; the calls take turns."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        call()
    for _ in range(effort.repeats):
        for name, call in calls.items():
            times[name].append(seconds(call, effort.at_least))
    return {name: 1e6 * median(samples) for name, samples in times.items()}


def arms() -> dict[str, rd.Robot]:
    """The arms of every table."""
    return {"UR5": rd.load("ur5"), "Panda-7": rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})}


def table(*headings: str) -> None:
    """The head of a table; words to the left, numbers to the right."""
    print("\n| " + " | ".join(headings) + " |")
    print(
        "|" + "|".join("---" if heading in ("arm", "query", "what", "process") else "--:" for heading in headings) + "|"
    )


def row(*cells: object) -> None:
    """A row of a table."""
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)
