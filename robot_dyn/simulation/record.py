"""What a march leaves behind: its samples at t = 0, T, 2 T, …, and the positions that companion runs share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np

from robot_dyn.simulation.march import Counter, DivergedError, Sample, Systems, march
from robot_dyn.simulation.motion import Motion
from robot_dyn.simulation.observer import Observer
from robot_dyn.simulation.setup import Setup
from robot_dyn.simulation.trajectory import Ending, Outcome


@final
@dataclass(frozen=True)
class Record:
    """The states of a run.

    Attributes:
        outcome: How it ended.
        t: Of the samples, (k,), in [s].
        y: States of the motion, (k, m).
        held: What a sampled controller holds, (k, n); None for any other.
        shared_t: Times at which companion runs are compared, (c,), in [s].
        shared_q: Positions there, (c, n).
        steps: Number of steps.
        evaluations: Of the equation of motion.
    """

    outcome: Outcome
    t: np.ndarray
    y: np.ndarray
    held: np.ndarray | None
    shared_t: np.ndarray
    shared_q: np.ndarray
    steps: int
    evaluations: int


def collect(
    setup: Setup,
    motion: Motion,
    factor: int,
    thin: int,
    systems: Systems | None = None,
    on_progress: Callable[[float], object] | None = None,
    observer: Observer | None = None,
) -> Record:
    """March in Python; keep samples at the record period, and positions at the times that companions share.

    Args:
        setup: What to run.
        motion: Its equation of motion.
        factor: Length of a step, in steps of the setup.
        thin: Shared states between those that are kept.
        systems: As of `march`.
        on_progress: Called with the time reached at each step.
        observer: Sees each step.
    """
    counter, kept, shared = Counter(observer), list[Sample](), list[Sample]()
    if observer is not None:
        systems = partial(systems or motion.system, seen=observer.seen)
    next_record, t, seen = 0.0, 0.0, 0
    try:
        with np.errstate(all="ignore"):  # what overflows ends the march
            for sample in march(setup, motion, factor, counter, systems):
                t, last = sample.t, sample.t == setup.duration_s
                if t >= next_record - 1e-9 * setup.step_s or last:
                    kept.append(sample)
                    next_record += setup.record_period_s
                if sample.shared:
                    if seen % thin == 0 or last:
                        shared.append(sample)
                    seen += 1
                if on_progress is not None:
                    on_progress(t)
        outcome = Outcome(Ending.FINISHED, t)
    except DivergedError as end:
        outcome = Outcome(Ending.DIVERGED, end.t, str(end))
    except KeyboardInterrupt:
        outcome = Outcome(Ending.STOPPED, t, "interrupted; all samples up to here are kept")
    n = motion.plant.dynamics.n
    held = np.array([sample.held for sample in kept]) if motion.sampled else None
    return Record(
        outcome, np.array([sample.t for sample in kept]), np.array([sample.y for sample in kept]), held,
        np.array([sample.t for sample in shared]), np.array([sample.y[:n] for sample in shared]).reshape(-1, n),
        counter.steps, counter.evaluations,
    )  # fmt: skip
