"""Median times of calls that take turns, so that changes of the machine's speed affect all of them."""

from __future__ import annotations

import timeit
from collections.abc import Callable, Mapping
from statistics import median
from time import perf_counter


def seconds(call: Callable[[], object], at_least: float, clock: Callable[[], float] = perf_counter) -> float:
    """Time of one call in [s], over a loop of about `at_least` seconds."""
    timer, number = timeit.Timer(call, timer=clock), 1
    while (taken := timer.timeit(number)) < at_least:
        number = max(2 * number, int(1.2 * number * at_least / max(taken, 1e-9)))
    return taken / number


def in_turns(calls: Mapping[str, Callable[[], object]], repeats: int, at_least: float) -> dict[str, float]:
    """Median time of each call in [s], over so many turns; the first call of each is not counted."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        call()
    for _ in range(repeats):
        for name, call in calls.items():
            times[name].append(seconds(call, at_least))
    return {name: median(samples) for name, samples in times.items()}
