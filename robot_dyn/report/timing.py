"""Times of calls that take turns, so that changes of the machine's speed affect all of them."""

from __future__ import annotations

import timeit
from collections.abc import Callable, Mapping, Sequence
from time import perf_counter

TURNS = 5
_AGREE = 1.05  # ratio of the two least times


def repeatable(times: Sequence[float]) -> bool:
    """Whether a time is known: after at least five turns the two least ones agree to 5 %.

    What else a machine does makes times longer and never shorter, so that the least one is that of the call.
    """
    least = sorted(times)[:2]
    return len(times) >= TURNS and least[-1] <= _AGREE * least[0]


def seconds(call: Callable[[], object], at_least: float, clock: Callable[[], float] = perf_counter) -> float:
    """Time of one call in [s], over a loop of about `at_least` seconds."""
    timer, number = timeit.Timer(call, timer=clock), 1
    while (taken := timer.timeit(number)) < at_least:
        number = max(2 * number, int(1.2 * number * at_least / max(taken, 1e-9)))
    return taken / number


def in_turns(calls: Mapping[str, Callable[[], object]], repeats: int, at_least: float) -> dict[str, list[float]]:
    """Times of each call in [s], over so many turns; the first call of each is not counted."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        call()
    for _ in range(repeats):
        for name, call in calls.items():
            times[name].append(seconds(call, at_least))
    return times
