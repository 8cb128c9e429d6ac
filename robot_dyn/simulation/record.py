"""What a march leaves behind: its samples at t = 0, T, 2 T, …, and the positions that companion runs share."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np

from robot_dyn.simulation.march import Counter, DivergedError, Sample, Systems, march
from robot_dyn.simulation.motion import Motion
from robot_dyn.simulation.observer import Observer
from robot_dyn.simulation.samples import row
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
        rows: What follows from them, side by side as of `samples.row`; None where machine code gives it.
        shared_t: Times at which companion runs are compared, (c,), in [s].
        shared_q: Positions there, (c, n).
        steps: Number of steps.
        evaluations: Of the equation of motion.
    """

    outcome: Outcome
    t: np.ndarray
    y: np.ndarray
    held: np.ndarray | None
    rows: np.ndarray | None
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
        factor: Length of a step, in steps of the setup; 1 keeps samples.
        thin: Shared states between those that are kept.
        systems: As of `march`.
        on_progress: Called with the time reached at each step.
        observer: Sees each step.
    """
    kept = _Kept(motion, derived=systems is None)
    counter, shared, start = Counter(observer), list[Sample](), motion.start(setup.q0, setup.v0)
    if observer is not None:
        systems = partial(systems or motion.system, seen=observer.seen)
    next_record, t, seen = 0.0, 0.0, 0
    try:
        with np.errstate(all="ignore"):  # what overflows ends the march
            for sample in march(setup, motion, factor, counter, systems):
                t, last = sample.t, sample.t == setup.duration_s
                if factor == 1 and (t >= next_record - 1e-9 * setup.step_s or last):
                    kept.add(sample)
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
    if factor == 1 and not kept.numbers:  # interrupted, or without a tick, at once
        kept.add(Sample(0.0, start, np.full_like(setup.q0, np.nan) if motion.sampled else None, shared=True))
    n = motion.plant.dynamics.n
    return Record(
        outcome, *kept.columns(len(start)),
        np.array([sample.t for sample in shared]), np.array([sample.y[:n] for sample in shared]).reshape(-1, n),
        counter.steps, counter.evaluations,
    )  # fmt: skip


@final
class _Kept:
    """Samples as numbers in one growing array: t, y, what is held, and what follows from them, one after the other.

    What follows is computed at once, so that a run that is interrupted has it.
    """

    def __init__(self, motion: Motion, derived: bool) -> None:
        self.motion, self.derived, self.numbers, self.width = motion, derived, array("d"), 1

    def add(self, sample: Sample) -> None:
        """Keep a sample."""
        parts = [[sample.t], sample.y, [] if sample.held is None else sample.held]
        if self.derived:
            parts.append(row(self.motion, sample.t, sample.y, sample.held))
        numbers = np.concatenate(parts)
        self.width = len(numbers)
        self.numbers.frombytes(numbers.tobytes())

    def columns(self, m: int) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray | None]:
        """t, y of m entries, held and rows."""
        table = np.frombuffer(self.numbers).reshape(-1, self.width)
        end = 1 + m + (self.motion.plant.dynamics.n if self.motion.sampled else 0)
        held = table[:, 1 + m : end] if self.motion.sampled else None
        return table[:, 0].copy(), table[:, 1 : 1 + m], held, table[:, end:] if self.derived else None
