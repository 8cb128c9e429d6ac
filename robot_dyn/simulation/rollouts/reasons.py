"""Reasons for the end of runs of a batch: the judgement of `simulate`, applied to the record of a run."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from robot_dyn.simulation.diagnostics.runaway import step_too_long
from robot_dyn.simulation.diagnostics.unstable_loop import explained, unstable
from robot_dyn.simulation.run.outcome import Outcome
from robot_dyn.simulation.setup.setup import Setup


class Runs(Protocol):
    """Recorded runs of a batch; see `RolloutsData`."""

    @property
    def t(self) -> np.ndarray: ...
    @property
    def q(self) -> np.ndarray | None: ...
    @property
    def v(self) -> np.ndarray | None: ...
    @property
    def ends(self) -> tuple[Outcome, ...]: ...
    def setup_of(self, run: int) -> Setup: ...


def reason_of(runs: Runs, run: int) -> Outcome:
    """Return the outcome of a run that diverged, with its step or its loop as the reason if that explains it.

    The search for a stable period or stable gains is left to `simulate`, since it takes most of the time.
    """
    end, setup = runs.ends[run], runs.setup_of(run)
    loop = unstable(setup, *states(runs, setup, run), runs_away=True, remedies=False)
    return explained(end, setup, (*step_too_long(setup, end.t), *loop))


def states(runs: Runs, setup: Setup, run: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times (m,) and states (m, size) of a run; the start alone if not all of the state was recorded."""
    equation = setup.equation
    if runs.q is None or runs.v is None or equation.equation_of_motion.state_size:
        return np.zeros(1), equation.start(setup.q0, setup.v0)[None]
    rest = np.zeros((len(runs.t), equation.size - 2 * len(setup.q0)))
    return runs.t, np.hstack([runs.q[run], runs.v[run], rest])
