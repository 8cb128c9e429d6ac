"""Runs of a batch one after the other on each thread; each has the steps and cuts of `simulate`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numpy as np

from robot_dyn.foundations.coefficients import with_values
from robot_dyn.simulation.compiled.choice import choose_for_batch, for_run
from robot_dyn.simulation.diagnostics.runaway import runaway, runaway_outcome
from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.observation.guard_levels import GuardLevels
from robot_dyn.simulation.observation.observation import Observation, observation_of, observed
from robot_dyn.simulation.observation.observer import observer_of
from robot_dyn.simulation.results.samples import columns
from robot_dyn.simulation.results.statistics import Statistics
from robot_dyn.simulation.rollouts.batch import Batch, Record, Single
from robot_dyn.simulation.rollouts.pool import in_threads
from robot_dyn.simulation.run.outcome import Ending, Outcome, Reason
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.run.run import Run
from robot_dyn.simulation.setup.setup import Setup


def singles(
    batch: Batch, levels: GuardLevels, threads: int, on_progress: Callable[[float], object] | None = None
) -> tuple[list[Single | None], Engine]:
    """Run each run of a batch separately, until Ctrl-C or an error of `on_progress`.

    Args:
        batch: The runs.
        levels: Their levels.
        threads: Number of threads.
        on_progress: Called with the mean time reached, in [s].

    Returns:
        The record of each run, None for a run that did not start before Ctrl-C, and the engine of the batch.
    """
    setup, engine = batch.setup, choose_for_batch(batch.setup, tuple(batch.sweep))
    records: list[Single | None] = [None] * len(batch)
    stop = np.zeros(1, np.int64)

    def make(i: int) -> None:
        if stop[0]:
            return
        plant, controller = batch.parts(i)
        own = with_values(setup, {"plant": plant, "controller": controller, "q0": batch.q0[i], "v0": batch.v0[i]})
        observer = observer_of(own, levels.of_runs([i]))
        run = Run(own, for_run(engine, setup, own), observer=observer)
        run.state.stop = stop
        recording = run.record()
        if too_fast := runaway(own, observer.fastest):
            recording = replace(recording, outcome=runaway_outcome(own, recording, too_fast))
        records[i] = _single(batch, own, recording, observer.observation)

    def report() -> None:
        if on_progress is not None:
            on_progress(setup.duration_s * sum(record is not None for record in records) / len(records))

    in_threads(make, len(records), threads if engine.is_compiled else 1, stop, report)
    if on_progress is not None and not stop[0]:
        on_progress(setup.duration_s)
    return records, engine


def _single(batch: Batch, setup: Setup, record: Recording, observation: Observation) -> Single:
    """Return the record of a run, without the sample at a terminal event, which is at no common time."""
    outcome = record.outcome
    early = outcome.ending is Ending.FINISHED and outcome.t < setup.duration_s
    rows = int(np.searchsorted(record.t, outcome.t)) if early else len(record.t)
    values = columns(setup.equation, record.t, record.y, record.sampled)
    recorded = {name: getattr(values, name)[:rows].copy() for name in batch.recorded}
    return Single(record.t[:rows], recorded, outcome, record.steps, record.evaluations, observation)


def one_by_one(batch: Batch, threads: int, on_progress: Callable[[float], object] | None = None) -> Record:
    """Return the record of a batch, run by `singles`; the record of a run that did not begin is its start."""
    setup, B, began = batch.setup, len(batch), perf_counter()
    levels = batch.levels(setup.plant, setup.controller)
    records, engine = singles(batch, levels, threads, on_progress)
    begun = {i: record for i, record in enumerate(records) if record is not None}
    t = max((record.t for record in begun.values()), key=len, default=np.zeros(1))
    q0, v0 = batch.q0.T, batch.v0.T
    starts = observation_of(np.vstack([q0, v0, np.full_like(q0, np.nan)]), levels)
    recorded = {name: np.full((B, len(t), size), np.nan) for name, size in batch.sizes.items()}
    for name, x in recorded.items():
        if name in ("q", "v"):
            x[:, 0] = batch.q0 if name == "q" else batch.v0
    label = f"{engine.label}, {B} run{'s' * (B > 1)} one after the other on each thread"
    step = 0.0 if setup.method.controls_error else setup.duration_s / setup.steps
    wall = perf_counter() - began
    steps, evaluations = (
        max((getattr(x, name) for x in begun.values()), default=0) for name in ("steps", "evaluations")
    )
    result = Record(
        setup, t, recorded, [Outcome(Reason.INTERRUPTED, 0.0)] * B, np.zeros(B, np.int64), np.zeros(B, np.int64),
        Statistics(
            setup.method.name, step, steps, evaluations, wall, engine=label, one_by_one=len(begun), one_by_one_s=wall
        ),
        observed([starts], levels, {i: record.observation for i, record in begun.items()}),
    )  # fmt: skip
    for i, record in begun.items():
        result.write(i, record)
    return result
