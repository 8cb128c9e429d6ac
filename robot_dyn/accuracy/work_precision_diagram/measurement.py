"""Measurement: each method under test runs its ladder as far as is worthwhile, then all runs are timed in turns."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from math import isfinite
from typing import final

from robot_dyn.accuracy.work_precision_diagram.method_under_test import MethodUnderTest, Run
from robot_dyn.accuracy.work_precision_diagram.reference_run import Reference
from robot_dyn.accuracy.work_precision_diagram.tolerance_ladder import (
    COMPILED,
    INTERPRETED,
    Point,
    ToleranceLadder,
    ladder_name,
)
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.report.time_budget import Budget, Limit, OvertimeError
from robot_dyn.report.timing import TURNS, repeatable

_PART = {COMPILED: 1 / 400, INTERPRETED: 1 / 150, "": 1 / 200}  # of the budget, for one run
_SHORT = 1 / 3000  # of the budget: runs that are timed again before the longer ones
_BRIEF_S, _OFTEN = 1e-3, 20  # runs that take less have so many turns: after five, some are 10 % off
_LATE = 3  # runs of a ladder that may take longer than that
_KEPT = {COMPILED: 0.2, INTERPRETED: 0.4, "": 0.2}  # of the budget, for repeats
_LAST = 0.05  # of the budget, for turns of short runs after the others
_HARD = 4.0  # times that, for a run that takes longer than was foreseen


@final
@dataclass(eq=False)
class Rung:
    """One run: its setting, what it left behind, its error and all its times."""

    setting: float
    run: Run
    error: float
    times: list[float]

    @property
    def repeatable(self) -> bool:
        """Whether its time is known."""
        return repeatable(self.times)

    @property
    def settled(self) -> bool:
        """Whether more turns would not change it."""
        return self.repeatable and (len(self.times) >= _OFTEN or self.times[0] >= _BRIEF_S)


@final
@dataclass(eq=False)
class Walk:
    """A method under test and the runs of its ladder."""

    method: MethodUnderTest
    rungs: list[Rung] = field(default_factory=list)
    ended: str = ""

    @property
    def name(self) -> str:
        """Of the candidate, as of its ladder."""
        return ladder_name(self.method.method, self.method.engine, self.method.events)

    def longest(self, budget: Budget) -> float:
        """Time that a run may take, in [s]."""
        return _PART[self.method.engine] * budget.seconds

    def ladder(self, floor: float) -> ToleranceLadder:
        """What was found, with errors above `floor` believed."""
        of = self.method
        points = tuple(
            Point(
                each.setting, each.run.steps, each.run.evaluations, each.error, each.run.energy, min(each.times),
                len(each.times), isfinite(each.error) and each.error > floor, each.repeatable,
            )
            for each in self.rungs
        )  # fmt: skip
        return ToleranceLadder(of.method, of.engine, of.events, of.order, of.by, points, self.ended, floor)


def measure(
    candidates: Iterable[MethodUnderTest], reference: Reference, budget: Budget, repeats: int
) -> tuple[list[Walk], bool]:
    """The ladders of all candidates, each run timed so often, or until its time repeats, and whether Ctrl-C came."""
    walks = [Walk(each) for each in candidates]
    try:
        for each in walks:
            _walk(each, reference, budget)
        runs = [(each, rung) for each in walks for rung in each.rungs if isfinite(rung.error)]
        short = [(each, rung) for each, rung in runs if rung.times[0] <= _SHORT * budget.seconds]
        others = [each for each in runs if each not in short]
        slow = [(each, rung) for each, rung in others if each.method.engine == INTERPRETED]
        # turns of the short ones are before and after the others: a machine may be slower for some seconds
        _turns(short, TURNS // 2, 0.0, budget)
        _turns([each for each in others if each not in slow], repeats - 1, _LAST * budget.seconds, budget)
        _turns(short, repeats - 1 - TURNS // 2, 0.0, budget)
        _turns(slow, repeats - 1, 0.0, budget)
    except KeyboardInterrupt:
        return walks, True
    return walks, False


def _walk(walk: Walk, reference: Reference, budget: Budget) -> None:
    """Run from coarse to fine, until the error of the reference is reached or the next run would take too long."""
    method, longest, before = walk.method, walk.longest(budget), 0.0
    late = 0
    for setting in method.settings():
        if budget.left <= _KEPT[method.engine] * budget.seconds:
            walk.ended = f"the budget of {budget.seconds:g} s ended"
            return
        if walk.rungs and isfinite(walk.rungs[-1].error):
            foreseen = method.growth(before, setting) * walk.rungs[-1].times[0]
            if foreseen > longest:
                walk.ended = f"a finer run would take more than {longest:.2g} s"
                return
        budget.report(f"{walk.name}, {method.by} {setting:.3g}")
        try:
            if not before:
                budget.report(f"{walk.name}: loading")
                with budget.apart():  # what is compiled or loaded once
                    method.warm()
            before = setting
            run = method.run(setting, Limit(_HARD * longest))
        except OvertimeError:
            walk.ended = f"a run with {method.by} {setting:.3g} takes more than {_HARD * longest:.2g} s"
            late += 1
            if late < _LATE and not any(isfinite(each.error) for each in walk.rungs):
                continue  # steps that are too long may lead to a motion that takes longer
            return
        except RobotDynError as error:
            walk.ended = str(error)
            return
        error = reference.distance(run)
        walk.rungs.append(Rung(setting, run, error, [run.time_s]))
        if error <= reference.error:
            walk.ended = "the error of the reference is reached"
            return
    walk.ended = "there is no finer setting"


def _turns(runs: list[tuple[Walk, Rung]], most: int, kept: float, budget: Budget) -> None:
    """Time runs in turns, until their times are settled, or so often, or no more of the budget is left than is kept."""
    for k in range(most):
        for walk, rung in runs:
            if budget.left <= kept:
                return
            if not rung.settled:
                budget.report(f"round {k + 2}: {walk.name}")
                _again(walk, rung, budget)


def _again(walk: Walk, rung: Rung, budget: Budget) -> None:
    """One more time of a run."""
    with suppress(OvertimeError):
        rung.times.append(walk.method.run(rung.setting, Limit(_HARD * walk.longest(budget))).time_s)
