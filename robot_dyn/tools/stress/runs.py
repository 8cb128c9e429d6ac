"""Random runs, each error estimate held against two better runs: one that is too small and says nothing misleads.

The better runs share the equations with the run, and neither its method nor its steps: DOP853 and an implicit method
near rounding. What both miss is found by `compare` and by energy alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from robot_dyn import Robot, RobotDynError, Setup, Trajectory, simulate
from robot_dyn.accuracy import Batch
from robot_dyn.integrate import Adaptive
from robot_dyn.report import Budget
from robot_dyn.simulation import Ending
from robot_dyn.tools.stress.confirm import LEAST, says
from robot_dyn.tools.stress.finding import JudgedRun
from robot_dyn.tools.stress.scenes import scenes
from robot_dyn.tools.stress.shrink import shrunk
from robot_dyn.tools.stress.work import Work

_BETTER = (Adaptive("DOP853", 3e-14, 1e-15), Adaptive("Rosenbrock", 1e-11, 1e-13))
_ROUNDING = 1e-12  # of 1 + |q|: below it neither can tell
_ONE_TIME = 1e-12  # [s]
_MOST_TRIES = 25  # of the start of a run that misleads


def judged_runs(robot: Robot, states: Batch, count: int, rng: np.random.Generator, work: Work) -> Iterator[JudgedRun]:
    """So many random runs."""
    for k, make in enumerate(scenes(robot, states, count, rng), 1):
        if work.over:
            work.skip(f"runs {k} to {count}" if k < count else f"run {k}")
            return
        scene = work.do(f"scene of run {k}", lambda _, make=make: make())
        if scene is None:
            continue
        found = work.do(f"run {k}, {scene.what}", lambda until, of=scene: judged(of.setup, of.what, until))
        if found is not None:
            yield shrunk_run(scene.setup, found, f"shrinking of run {k}", work) if found.misleads else found


def judged(setup: Setup, what: str, budget: Budget) -> JudgedRun:
    """A run beside two better ones.

    Raises:
        RobotDynError: If one of these cannot be made.
        OvertimeError: If the budget ends.
    """
    run = simulate(setup, on_progress=budget.check)
    report = says(run) if run.outcome.ending is Ending.FINISHED else f"{run.outcome.ending} at {run.outcome.t:.3g} s"
    error = run.error
    if error is None or run.outcome.ending is not Ending.FINISHED or not error.until_s:
        return JudgedRun(what, setup.duration_s, np.nan, np.nan, np.nan, report, False, setup)
    sure = replace(setup, step_s=None, estimate_error=False, integrator=_BETTER[0])
    better = [simulate(replace(sure, integrator=each), on_progress=budget.check) for each in _BETTER]
    known, estimate = run.t <= error.until_s, error.at(error.until_s)
    if any(each.outcome.ending is not Ending.FINISHED for each in better):
        raise RobotDynError("a better run did not finish")
    if any(each.t.shape != run.t.shape or np.abs(each.t - run.t).max() > _ONE_TIME for each in better):
        raise RobotDynError("the better runs have other samples")
    true = float(np.abs(run.q - better[0].q)[known].max())
    unsure = float(np.abs(better[1].q - better[0].q)[known].max())
    floor = _ROUNDING * (1 + float(np.abs(run.q).max())) + unsure
    misleads = not says_more(run) and max(estimate, floor) < LEAST * max(true, floor)
    return JudgedRun(what, setup.duration_s, estimate, true, unsure, report or str(error), misleads, setup)


def says_more(run: Trajectory) -> bool:
    """Whether something but the estimate warns."""
    return bool(run.error is not None and run.error.note) or "does not close" in run.summary


def shrunk_run(setup: Setup, found: JudgedRun, name: str, work: Work) -> JudgedRun:
    """A run that misleads, from the start of fewest digits that was found; itself if that is none."""
    least = found

    def shrink(budget: Budget) -> np.ndarray:
        def fails(x: np.ndarray) -> bool:
            nonlocal least
            q0, v0 = np.split(x, 2)
            try:
                young = judged(replace(setup, q0=q0, v0=v0), found.what, budget)
            except RobotDynError:
                return False
            least = young if young.misleads else least
            return young.misleads

        return shrunk(np.concatenate([setup.q0, setup.v0]), fails, _MOST_TRIES)

    work.do(name, shrink)
    return least
