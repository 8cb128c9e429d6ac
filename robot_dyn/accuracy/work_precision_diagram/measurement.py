"""Measurement: every method under test runs its ladder, from coarse to fine; then all runs are timed in turns."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import final

from robot_dyn.accuracy.work_precision_diagram.method_under_test import (
    COMPILED,
    INTERPRETED,
    MethodUnderTest,
    Point,
    Run,
    ToleranceLadder,
)
from robot_dyn.accuracy.work_precision_diagram.reference_run import Reference
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.report.result import INTERRUPTED
from robot_dyn.report.time_budget import Budget, OvertimeError
from robot_dyn.report.timing import Timed, take_turns

_RUN_FRACTION = {COMPILED: 1 / 400, INTERPRETED: 1 / 150, "": 1 / 200}  # fraction of the budget for one run
_RESERVE = {COMPILED: 0.2, INTERPRETED: 0.4, "": 0.2}  # fraction of the budget kept for repeats when new runs start
_INTERPRETED_RESERVE = 0.05  # fraction of the budget kept for interpreted runs while the others are repeated
_MAX_LATE = 3  # runs of a ladder that may exceed their time limit
_HARD = 4.0  # time limit of a run, over its planned time


@final
@dataclass(eq=False)
class Walk:
    """A method under test, its runs from coarse to fine, and the reason why its ladder ended."""

    method: MethodUnderTest
    runs: list[tuple[Point, Timed]] = field(default_factory=list)
    ended: str = ""

    def add(self, setting: float, reference: Reference, longest: float) -> Point:
        """Run a setting within the time `longest`, in [s], and return its point."""

        def run() -> Run:
            return self.method.run(setting, Budget(longest).check)

        first = run()
        error = reference.distance(first)
        resolved = isfinite(error) and error > reference.error
        point = Point(setting, first.steps, first.evaluations, error, first.energy, resolved)
        self.runs.append((point, Timed(self.method.name, lambda: run().time_s, [first.time_s])))
        return point

    def ladder(self, floor: float) -> ToleranceLadder:
        """Return the runs with all their times; `floor` is the error of the reference."""
        points = tuple(replace(point, times=tuple(timed.times)) for point, timed in self.runs)
        method = self.method
        return ToleranceLadder(
            method=method.method,
            engine=method.engine,
            events=method.events,
            order=method.order,
            by=method.by,
            points=points,
            ended=self.ended,
            floor=floor,
        )


def measure(
    candidates: Iterable[MethodUnderTest], reference: Reference, budget: Budget, repeats: int
) -> tuple[tuple[ToleranceLadder, ...], list[str]]:
    """Run the ladders of all candidates and repeat their runs; return the ladders, and notes on omitted ones.

    A run is repeated until its time settles, up to `repeats` times.
    """
    walks, left_out = [Walk(candidate) for candidate in candidates], list[str]()
    try:
        for walk in walks:
            walk.ended = _walk(walk, reference, budget)
        for is_interpreted, reserve in ((False, _INTERPRETED_RESERVE), (True, 0.0)):
            group = [walk for walk in walks if (walk.method.engine == INTERPRETED) is is_interpreted]
            runs = [timed for walk in group for point, timed in walk.runs if isfinite(point.error)]
            take_turns(runs, repeats - 1, budget, reserve * budget.seconds, until_settled=True)
    except KeyboardInterrupt:
        left_out = [INTERRUPTED]
    ladders = tuple(walk.ladder(reference.error) for walk in walks if walk.runs)
    return ladders, [f"{walk.method.name}: {walk.ended}" for walk in walks if not walk.runs] + left_out


def _walk(walk: Walk, reference: Reference, budget: Budget) -> str:
    """Run from coarse to fine, until the error of the reference is reached or the next run would take too long.

    Return the reason why the ladder ended.
    """
    method, before, late = walk.method, 0.0, 0
    longest = _RUN_FRACTION[method.engine] * budget.seconds
    for setting in method.settings():
        if budget.left <= _RESERVE[method.engine] * budget.seconds:
            return f"the budget of {budget.seconds:g} s ended"
        for point, timed in walk.runs[-1:]:
            if isfinite(point.error) and method.growth(before, setting) * timed.times[0] > longest:
                return f"a finer run would take more than {longest:.2g} s"
        budget.report(f"{method.name}, {method.by} {setting:.3g}")
        try:
            if not before:
                budget.report(f"{method.name}: loading")
                with budget.apart():  # code is compiled or loaded once
                    method.warm()
            before = setting
            if walk.add(setting, reference, _HARD * longest).error <= reference.error:
                return "the error of the reference is reached"
        except OvertimeError:
            late += 1
            if late == _MAX_LATE or any(isfinite(point.error) for point, _ in walk.runs):
                return f"a run with {method.by} {setting:.3g} takes more than {_HARD * longest:.2g} s"
            # otherwise continue: with too long steps, the computed motion itself may take longer to integrate
        except RobotDynError as error:
            return str(error)
    return "there is no finer setting"
