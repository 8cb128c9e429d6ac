"""Why runs of a batch diverged, where an unstable sampled loop explains it."""

from __future__ import annotations

import numpy as np

from robot_dyn.simulation.diagnostics.divergence import explained
from robot_dyn.simulation.diagnostics.unstable_loop import unstable
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.rollouts.result import Rollouts
from robot_dyn.simulation.rollouts.run import setup_of
from robot_dyn.simulation.setup.setup import Setup

_JUDGED = 8  # runs of a batch: each loop is linearised about a start of its own


def causes(runs: Rollouts, setup: Setup, q0: np.ndarray, v0: np.ndarray) -> tuple[str, ...]:
    """The advice of each run; of the first that diverged with its loop as the cause, where that explains it.

    Loops are linearised about the starts, which differ from run to run, as their parameters may.

    Args:
        runs: A batch.
        setup: Of all of it.
        q0: Positions at the starts, (B, n).
        v0: Velocities there.
    """
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
