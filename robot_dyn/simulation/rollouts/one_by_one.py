"""Runs of a batch one after the other on each thread, each as `simulate` runs it: with its own steps and cuts."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple, final

import numpy as np

from robot_dyn.foundations.coefficients import with_values
from robot_dyn.simulation.compiled.choice import choose_for_batch, for_run
from robot_dyn.simulation.diagnostics.step_remarks import observer_of
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.observation.guard_levels import GuardLevels
from robot_dyn.simulation.observation.observation import Observation, Observed, observation_of, observed
from robot_dyn.simulation.results.samples import columns
from robot_dyn.simulation.results.statistics import Statistics
from robot_dyn.simulation.rollouts.batch import Batch, Ends, advice_of
from robot_dyn.simulation.rollouts.pool import in_threads
from robot_dyn.simulation.rollouts.result import Rollouts
from robot_dyn.simulation.run.make_run import make_run
from robot_dyn.simulation.run.outcome import Ending, Outcome
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.setup.setup import Setup


class Single(NamedTuple):
    """The record of one run by itself.

    Attributes:
        t: Times of its samples, (k,), in [s].
        columns: What was recorded, (k, …) by name.
        outcome: How it ended.
        steps, evaluations: Their numbers.
        observation: What was observed of it.
    """

    t: np.ndarray
    columns: dict[str, np.ndarray]
    outcome: Outcome
    steps: int
    evaluations: int
    observation: Observation


@final
class OneByOne:
    """The runs and their records.

    Args:
        batch: The runs.
        levels: Their levels.
    """

    def __init__(self, batch: Batch, levels: GuardLevels) -> None:
        self.batch, self.setup, self.levels = batch, batch.setup, levels
        self.engine = choose_for_batch(self.setup, tuple(batch.sweep))
        self.records: list[Single | None] = [None] * len(batch)
        self.stop = np.zeros(1, np.int64)

    def _run_of(self, run: int) -> tuple[Setup, Engine]:
        """The setup of a run, and its engine."""
        plant, controller = self.batch.parts(run)
        changes = {"plant": plant, "controller": controller, "q0": self.batch.q0[run], "v0": self.batch.v0[run]}
        setup = with_values(self.setup, changes)
        return setup, for_run(self.engine, self.setup, setup)

    def run(self, threads: int, on_progress: Callable[[float], object] | None = None) -> None:
        """Run all; Ctrl-C ends them, and an error of `on_progress`, which is called with the mean time reached."""
        end = self.setup.duration_s

        def look() -> None:
            if on_progress is not None:
                on_progress(end * sum(each is not None for each in self.records) / len(self.records))

        in_threads(self._run, len(self.records), int(min(threads, self.engine.most_threads)), self.stop, look)
        if on_progress is not None and not self.stop[0]:
            on_progress(end)

    def _run(self, i: int) -> None:
        if self.stop[0]:
            return
        setup, engine = self._run_of(i)
        observer = observer_of(setup, self.levels.of_runs([i]))
        run = make_run(setup, engine, observer=observer)
        run.stop = self.stop
        self.records[i] = self._single(setup.equation, run.record(), observer.observation)

    def _single(self, equation: StateEquation, record: Recording, observation: Observation) -> Single:
        """The record of a run without the sample at an event that ended it, which no other run has."""
        outcome = record.outcome
        early = outcome.ending is Ending.FINISHED and outcome.t < self.setup.duration_s
        rows = int(np.searchsorted(record.t, outcome.t)) if early else len(record.t)
        values = columns(equation, record.t, record.y, record.made)
        recorded = {name: getattr(values, name)[:rows].copy() for name in self.batch.recorded}
        return Single(record.t[:rows], recorded, outcome, record.steps, record.evaluations, observation)

    def observed(self) -> Observed:
        """What was observed of all runs; of one that did not begin, its start."""
        q0, v0 = self.batch.q0.T, self.batch.v0.T
        starts = np.vstack([q0, v0, np.full_like(q0, np.nan)])
        known = {i: each.observation for i, each in enumerate(self.records) if each is not None}
        return observed([observation_of(starts, self.levels)], self.levels, known)


def one_by_one(batch: Batch, most: int, threads: int, on_progress: Callable[[float], object] | None = None) -> Rollouts:
    """The rollouts of a batch, as of `OneByOne`; `most` is the number of bytes to record at most."""
    setup, B = batch.setup, len(batch)
    batch.check_size(most)
    runs, began = OneByOne(batch, batch.levels(setup.plant, setup.controller)), perf_counter()
    runs.run(threads, on_progress)
    t = max((each.t for each in runs.records if each is not None), key=len, default=np.zeros(1))
    recorded = {name: np.full((B, len(t), size), np.nan) for name, size in batch.sizes.items()}
    for i, each in enumerate(runs.records):
        start = {"q": batch.q0[i : i + 1], "v": batch.v0[i : i + 1]}  # of a run that did not begin
        for name, x in (start if each is None else each.columns).items():
            if name in recorded:
                recorded[name][i, : len(x)] = x
    outcomes = [Outcome(Ending.STOPPED, 0.0) if each is None else each.outcome for each in runs.records]
    counts = [(0, 0) if each is None else (each.steps, each.evaluations) for each in runs.records]
    steps, evaluations = np.array(counts, np.int64).T.copy()
    ending = np.array([each.ending.value for each in outcomes])
    ends = Ends(
        np.array([each.t for each in outcomes]), ending == Ending.DIVERGED, ending == Ending.STOPPED,
        tuple(map(advice_of, outcomes)), steps, evaluations,
    )  # fmt: skip
    engine = f"{runs.engine.label}, {B} run{'s' * (B > 1)} one after the other on each thread"
    step = 0.0 if setup.integrator.controls_error else setup.duration_s / setup.steps
    most_steps, most_evaluations, spent = int(steps.max()), int(evaluations.max()), perf_counter() - began
    statistics = Statistics(setup.integrator.name, step, most_steps, most_evaluations, spent, engine=engine)
    return batch.rollouts(setup, t, recorded, ends, statistics, runs.observed())
