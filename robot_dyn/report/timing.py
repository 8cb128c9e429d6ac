"""Runs timed alternately, so that changes of the machine's speed affect all of them."""

from __future__ import annotations

import timeit
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import nan
from time import perf_counter
from typing import final

from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.result import UNREPORTED, reported
from robot_dyn.report.time_budget import Budget, OvertimeError

TURNS = 5
_AGREE = 1.05  # largest ratio of the two smallest times
_BRIEF_S, _OFTEN = 1e-3, 20  # shorter runs settle after 20 turns: after five, some are 10 % off


@dataclass(frozen=True, kw_only=True)
class Repeated:
    """Base class of results that were timed in turns.

    Attributes:
        times: Times of the turns, in [s]; empty if it was not timed.
    """

    times: tuple[float, ...] = field(default=(), metadata=UNREPORTED)

    @reported
    def time_s(self) -> float:
        """Smallest time, in [s]; nan if it was not timed."""
        return min(self.times, default=nan)

    @reported
    def repeats(self) -> int:
        """Number of turns."""
        return len(self.times)

    @reported
    def repeatable(self) -> bool:
        """True if there were at least five turns whose two smallest times differ by at most 5 %."""
        return repeatable(self.times)


@final
@dataclass(eq=False)
class Timed:
    """A run and its times.

    Attributes:
        name: Name in reports.
        run: Function that runs it once and returns the time, in [s].
        times: Times of the turns, in [s].
    """

    name: str
    run: Callable[[], float]
    times: list[float] = field(default_factory=list)

    @property
    def settled(self) -> bool:
        """True if more turns would not change the smallest time."""
        return repeatable(self.times) and (len(self.times) >= _OFTEN or self.times[0] >= _BRIEF_S)


def repeatable(times: Sequence[float]) -> bool:
    """Return True if a time is reliable: after at least five turns, the two smallest times agree to 5 %.

    Other work of the machine can only make times longer, so the smallest time is the best estimate.
    """
    least = sorted(times)[:2]
    return len(times) >= TURNS and least[-1] <= _AGREE * least[0]


def seconds(call: Callable[[], object], at_least: float, clock: Callable[[], float] = perf_counter) -> float:
    """Measure the time of one call in [s], over a loop of about `at_least` seconds."""
    timer, number = timeit.Timer(call, timer=clock), 1
    while (duration := timer.timeit(number)) < at_least:
        number = max(2 * number, int(1.2 * number * at_least / max(duration, 1e-9)))
    return duration / number


def take_turns(
    runs: Iterable[Timed], turns: int, budget: Budget, kept_s: float = 0.0, until_settled: bool = False
) -> dict[str, RobotDynError]:
    """Time runs alternately, at most `turns` times; return the errors of failing runs, by name.

    The first run of each, which compiles and loads, is neither counted nor charged to the budget.

    Args:
        runs: The runs.
        turns: Number of turns.
        budget: Time budget.
        kept_s: Reserve of the budget, in [s].
        until_settled: True to stop repeating a run when its time is settled.
    """
    left, failed = list(runs), dict[str, RobotDynError]()
    for turn in range(turns):
        for timed in tuple(left):
            if budget.left <= kept_s:
                return failed
            if until_settled and timed.settled:
                continue
            budget.report(f"round {turn + 1}: {timed.name}")
            try:
                if not timed.times:
                    with budget.apart():
                        timed.run()
                timed.times.append(timed.run())
            except OvertimeError:
                continue
            except RobotDynError as error:
                failed[timed.name] = error
                left.remove(timed)
    return failed


def in_turns(calls: Mapping[str, Callable[[], object]], repeats: int, at_least: float) -> dict[str, list[float]]:
    """Return `repeats` times of each call, in [s], over loops of about `at_least` seconds.

    Raises:
        RobotDynError: If a call raises one.
    """
    runs = [Timed(name, lambda call=call: seconds(call, at_least)) for name, call in calls.items()]
    for error in take_turns(runs, repeats, Budget()).values():
        raise error
    return {timed.name: timed.times for timed in runs}
