"""Why runs diverged, where an unstable sampled loop explains it: ρ(Φ)^(t/T) > 1e3 at the end t of a run.

Shorter steps follow the growth of such a loop more closely, and do not end it: the advice is then that on the loop.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from math import log
from typing import TYPE_CHECKING

import numpy as np

from robot_dyn.simulation.remarks import Kind, Remark, lines
from robot_dyn.simulation.setup import Setup
from robot_dyn.simulation.stability import periods
from robot_dyn.simulation.state_equation import StateEquation
from robot_dyn.simulation.trajectory import Ending, Outcome
from robot_dyn.simulation.unstable_loop import unstable

if TYPE_CHECKING:
    from robot_dyn.simulation.rollout_result import Rollouts

_EXPLAINS = 1e3  # growth of deviations
_JUDGED = 8  # runs of a batch: each loop is linearised about a start of its own


def explained(outcome: Outcome, setup: Setup, remarks: Iterable[Remark]) -> Outcome:
    """The outcome of a run; if it diverged and a remark on its loop explains it, with that as advice."""
    if outcome.ending is not Ending.DIVERGED or setup.controller is None:
        return outcome
    for remark in remarks:
        if remark.kind is Kind.UNSTABLE:
            elapsed = periods(outcome.t, setup.controller.period_s)
            if elapsed * log(remark.value) > log(_EXPLAINS):
                return replace(outcome, advice=lines([remark])[0])
    return outcome


def causes(runs: Rollouts, setup: Setup, q0: np.ndarray, v0: np.ndarray) -> tuple[str, ...]:
    """The advice of each run; of the first that diverged with its loop as the cause, where that explains it.

    Loops are linearised about the starts, which differ from run to run, as their parameters may.

    Args:
        runs: A batch.
        setup: Of all of it.
        q0: Positions at the starts, (B, n).
        v0: Velocities there.
    """
    from robot_dyn.simulation.rollout_run import setup_of

    advice, diverged = list(runs.advice), np.flatnonzero(runs.diverged)
    if setup.controller is None or not setup.controller.period_s or not len(diverged):
        return runs.advice
    earliest = diverged[np.argsort(runs.ended[diverged], kind="stable")]
    for run in list(dict.fromkeys([int(diverged[0]), *earliest.tolist()]))[:_JUDGED]:
        own = setup_of(runs, setup, run)
        equation = StateEquation(own.plant, own.controller, own.integrator.canonical)
        remarks = unstable(own, equation, np.zeros(1), equation.start(q0[run], v0[run])[None])
        advice[run] = explained(runs.outcome(run), own, remarks).advice
    return tuple(advice)
