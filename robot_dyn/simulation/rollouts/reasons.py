"""Reasons for the end of runs of a batch: the judgement of `simulate`, applied to the record of a run."""

from __future__ import annotations

from itertools import chain

import numpy as np

from robot_dyn.simulation.diagnostics.runaway import step_too_long
from robot_dyn.simulation.diagnostics.unstable_loop import explained, unstable
from robot_dyn.simulation.run.outcome import Outcome
from robot_dyn.simulation.setup.setup import Setup

Samples = tuple[np.ndarray, np.ndarray | None, np.ndarray | None]
"""Times (m,), positions and velocities (m, n) of a run; None where they were not recorded."""


def reason_of(setup: Setup, end: Outcome, samples: Samples) -> Outcome:
    """Return the outcome of a run that diverged, with its step or its loop as the reason if that explains it.

    Only `simulate` searches for a stable period or stable gains, because that takes most of the time.
    """
    step_s = end.facts.get("step_s")  # to find it from the setup takes long if there are many ticks
    step = step_too_long(setup, end.t, None if step_s is None else float(step_s))
    loop = unstable(setup, *states(setup, *samples), runs_away=True, remedies=False, end=end.t)
    return explained(end, setup, chain(step, loop))  # the loop is linearised only if the step explains nothing


def states(setup: Setup, t: np.ndarray, q: np.ndarray | None, v: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Return times (m,) and states (m, size) of a run; only the start if part of the state was not recorded."""
    equation = setup.equation
    if q is None or v is None or equation.equation_of_motion.state_size:
        return np.zeros(1), equation.start(setup.q0, setup.v0)[None]
    return t, np.hstack([q, v, np.zeros((len(t), equation.size - 2 * len(setup.q0)))])
