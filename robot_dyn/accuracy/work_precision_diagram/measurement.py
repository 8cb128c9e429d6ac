"""Measurement: each method under test runs its ladder as far as is worthwhile, then all runs are timed in turns."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import isfinite
from typing import final

from robot_dyn.accuracy.work_precision_diagram.method_under_test import MethodUnderTest, Run
from robot_dyn.accuracy.work_precision_diagram.reference_run import Reference
from robot_dyn.accuracy.work_precision_diagram.tolerance_ladder import COMPILED, INTERPRETED, Point, ToleranceLadder
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.report.time_budget import Budget, Limit, OvertimeError
from robot_dyn.report.timing import TURNS, Timed, repeatable, take_turns

_PART = {COMPILED: 1 / 400, INTERPRETED: 1 / 150, "": 1 / 200}  # of the budget, for one run
_SHORT = 1 / 3000  # of the budget: runs that are timed again before the longer ones
_LATE = 3  # runs of a ladder that may take longer than that
_KEPT = {COMPILED: 0.2, INTERPRETED: 0.4, "": 0.2}  # of the budget, for repeats
_LAST = 0.05  # of the budget, for turns of short runs after the others
_HARD = 4.0  # times that, for a run that takes longer than was foreseen


@final
@dataclass(frozen=True, eq=False)
class Rung:
    """One run: its setting, what it left behind, its error and all its times."""

    setting: float
    run: Run
    error: float
    timed: Timed


@final
@dataclass(eq=False)
class Walk:
    """A method under test and the runs of its ladder."""

    method: MethodUnderTest
    rungs: list[Rung] = field(default_factory=list)
    ended: str = ""

    def add(self, setting: float, reference: Reference, longest: float) -> float:
        """Run a setting within a time and return its error."""

        def run() -> Run:
            return self.method.run(setting, Limit(longest))

        first = run()
        error = reference.distance(first)
        self.rungs.append(Rung(setting, first, error, Timed(self.method.name, lambda: run().time_s, [first.time_s])))
        return error

    def ladder(self, floor: float) -> ToleranceLadder:
        """What was found, with errors above `floor` believed."""
        of, points = self.method, list[Point]()
        for each in self.rungs:
            run, times = each.run, each.timed.times
            believed = isfinite(each.error) and each.error > floor
            points.append(
                Point(
                    each.setting, run.steps, run.evaluations, each.error, run.energy, min(times), len(times), believed,
                    repeatable(times),
                )
            )  # fmt: skip
        return ToleranceLadder(of.method, of.engine, of.events, of.order, of.by, tuple(points), self.ended, floor)


def measure(
    candidates: Iterable[MethodUnderTest], reference: Reference, budget: Budget, repeats: int
) -> tuple[list[Walk], bool]:
    """The ladders of all candidates, each run timed so often, or until its time repeats, and whether Ctrl-C came."""
    walks, short = [Walk(each) for each in candidates], list[Timed]()
    long: dict[bool, list[Timed]] = {False: [], True: []}  # by whether they are interpreted
    try:
        for walk in walks:
            walk.ended = _walk(walk, reference, budget)
            for rung in walk.rungs:
                if isfinite(rung.error):
                    is_short = rung.timed.times[0] <= _SHORT * budget.seconds
                    (short if is_short else long[walk.method.engine == INTERPRETED]).append(rung.timed)
        more, first = repeats - 1, min(repeats - 1, TURNS // 2)
        # turns of the short ones are before and after the others: a machine may be slower for some seconds
        for runs, turns, kept in (
            (short, first, 0.0),
            (long[False], more, _LAST),
            (short, more - first, 0.0),
            (long[True], more, 0.0),
        ):
            take_turns(runs, turns, budget, kept * budget.seconds, until_settled=True)
    except KeyboardInterrupt:
        return walks, True
    return walks, False


def _walk(walk: Walk, reference: Reference, budget: Budget) -> str:
    """Run from coarse to fine, until the error of the reference is reached or the next run would take too long.

    Return why it ended.
    """
    method, before, late = walk.method, 0.0, 0
    longest = _PART[method.engine] * budget.seconds
    for setting in method.settings():
        if budget.left <= _KEPT[method.engine] * budget.seconds:
            return f"the budget of {budget.seconds:g} s ended"
        if walk.rungs and isfinite(walk.rungs[-1].error):
            foreseen = method.growth(before, setting) * walk.rungs[-1].run.time_s
            if foreseen > longest:
                return f"a finer run would take more than {longest:.2g} s"
        budget.report(f"{method.name}, {method.by} {setting:.3g}")
        try:
            if not before:
                budget.report(f"{method.name}: loading")
                with budget.apart():  # what is compiled or loaded once
                    method.warm()
            before = setting
            if walk.add(setting, reference, _HARD * longest) <= reference.error:
                return "the error of the reference is reached"
        except OvertimeError:
            late += 1
            if late == _LATE or any(isfinite(each.error) for each in walk.rungs):
                return f"a run with {method.by} {setting:.3g} takes more than {_HARD * longest:.2g} s"
            # otherwise continue: steps that are too long may lead to a motion that takes longer
        except RobotDynError as error:
            return str(error)
    return "there is no finer setting"
