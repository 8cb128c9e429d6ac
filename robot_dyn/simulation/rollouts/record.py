"""Recorded samples and ends of the runs of a batch, and one run of it made by `simulate`'s loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from robot_dyn.simulation.observation.observation import Observation, Observed
from robot_dyn.simulation.results.statistics import Statistics
from robot_dyn.simulation.run.outcome import Ending, Outcome
from robot_dyn.simulation.setup.setup import Setup


class Single(NamedTuple):
    """The record of one run.

    Attributes:
        t: Times of its samples, (k,), in [s].
        columns: Recorded quantities, (k, …) by name.
        outcome: How it ended.
        steps, evaluations: Their numbers.
        observation: Observations of all steps.
    """

    t: np.ndarray
    columns: dict[str, np.ndarray]
    outcome: Outcome
    steps: int
    evaluations: int
    observation: Observation


@final
@dataclass(eq=False)
class Record:
    """What a batch recorded, and how its runs ended; both ways of running write into its arrays.

    Attributes:
        setup: Setup whose equations ran.
        t: Times of the samples, (m,), in [s].
        columns: Recorded quantities, (B, m, size) by name; nan after the end of a run.
        ended, diverged, stopped, advice, steps, evaluations: See `Rollouts`.
        statistics: Statistics of the batch.
        observed: Observations of all runs.
    """

    setup: Setup
    t: np.ndarray
    columns: dict[str, np.ndarray]
    ended: np.ndarray
    diverged: np.ndarray
    stopped: np.ndarray
    advice: list[str]
    steps: np.ndarray
    evaluations: np.ndarray
    statistics: Statistics
    observed: Observed

    def write(self, run: int, single: Single) -> None:
        """Write the record of a run."""
        self.cut(run, len(single.t), single.outcome)
        for name, x in self.columns.items():
            x[run, : len(single.t)] = single.columns[name]
        self.steps[run], self.evaluations[run] = single.steps, single.evaluations

    def cut(self, run: int, rows: int, outcome: Outcome) -> None:
        """End a run after some of its samples."""
        for x in self.columns.values():
            x[run, rows:] = np.nan
        self.ended[run] = outcome.t
        self.diverged[run], self.stopped[run] = (outcome.ending is x for x in (Ending.DIVERGED, Ending.STOPPED))
        self.advice[run] = "" if outcome.ending is Ending.STOPPED else outcome.advice
