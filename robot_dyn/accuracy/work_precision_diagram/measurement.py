"""Measurement: each method under test runs its ladder as far as is worthwhile, then all runs are timed in turns."""

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

_PART = {COMPILED: 1 / 400, INTERPRETED: 1 / 150, "": 1 / 200}  # of the budget, for one run
_KEPT = {COMPILED: 0.2, INTERPRETED: 0.4, "": 0.2}  # of the budget, for repeats
_LAST = 0.05  # of the budget, for repeats of what is interpreted
_LATE = 3  # runs of a ladder that may take longer than their part
_HARD = 4.0  # times that, for a run that takes longer than was foreseen


@final
@dataclass(eq=False)
class Walk:
    """A method under test, its runs from coarse to fine, and why there is no finer one."""

    method: MethodUnderTest
    runs: list[tuple[Point, Timed]] = field(default_factory=list)
    ended: str = ""

    def add(self, setting: float, reference: Reference, longest: float) -> Point:
        """Run a setting within a time."""

        def run() -> Run:
            return self.method.run(setting, Budget(longest).check)

        first = run()
        error = reference.distance(first)
        believed = isfinite(error) and error > reference.error
        point = Point(setting, first.steps, first.evaluations, error, first.energy, believed)
        self.runs.append((point, Timed(self.method.name, lambda: run().time_s, [first.time_s])))
        return point

    def ladder(self, floor: float) -> ToleranceLadder:
        """Return the runs with all their times; `floor` is the error of the reference."""
        points = tuple(replace(point, times=tuple(timed.times)) for point, timed in self.runs)
        of = self.method
        return ToleranceLadder(of.method, of.engine, of.events, of.order, of.by, points, self.ended, floor)


def measure(
    candidates: Iterable[MethodUnderTest], reference: Reference, budget: Budget, repeats: int
) -> tuple[tuple[ToleranceLadder, ...], list[str]]:
    """Run the ladders of all candidates and repeat their runs; return them, and what was left out and why.

    A run is repeated until its time settles, and at most so often.
    """
    walks, left_out = [Walk(candidate) for candidate in candidates], list[str]()
    try:
        for walk in walks:
            walk.ended = _walk(walk, reference, budget)
        for interpreted, kept in ((False, _LAST), (True, 0.0)):
            some = [walk for walk in walks if (walk.method.engine == INTERPRETED) is interpreted]
            runs = [timed for walk in some for point, timed in walk.runs if isfinite(point.error)]
            take_turns(runs, repeats - 1, budget, kept * budget.seconds, until_settled=True)
    except KeyboardInterrupt:
        left_out = [INTERRUPTED]
    ladders = tuple(walk.ladder(reference.error) for walk in walks if walk.runs)
    return ladders, [f"{walk.method.name}: {walk.ended}" for walk in walks if not walk.runs] + left_out


def _walk(walk: Walk, reference: Reference, budget: Budget) -> str:
    """Run from coarse to fine, until the error of the reference is reached or the next run would take too long.

    Return why it ended.
    """
    method, before, late = walk.method, 0.0, 0
    longest = _PART[method.engine] * budget.seconds
    for setting in method.settings():
        if budget.left <= _KEPT[method.engine] * budget.seconds:
            return f"the budget of {budget.seconds:g} s ended"
        for point, timed in walk.runs[-1:]:
            if isfinite(point.error) and method.growth(before, setting) * timed.times[0] > longest:
                return f"a finer run would take more than {longest:.2g} s"
        budget.report(f"{method.name}, {method.by} {setting:.3g}")
        try:
            if not before:
                budget.report(f"{method.name}: loading")
                with budget.apart():  # what is compiled or loaded once
                    method.warm()
            before = setting
            if walk.add(setting, reference, _HARD * longest).error <= reference.error:
                return "the error of the reference is reached"
        except OvertimeError:
            late += 1
            if late == _LATE or any(isfinite(point.error) for point, _ in walk.runs):
                return f"a run with {method.by} {setting:.3g} takes more than {_HARD * longest:.2g} s"
            # otherwise continue: steps that are too long may lead to a motion that takes longer
        except RobotDynError as error:
            return str(error)
    return "there is no finer setting"
