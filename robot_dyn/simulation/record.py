"""What a march leaves behind: its samples at t = 0, T, 2 T, …, and the states that companion runs share."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import final

import numpy as np

from robot_dyn.simulation.march import Counter, DivergedError, Sample, Systems, march
from robot_dyn.simulation.motion import Motion
from robot_dyn.simulation.observer import Observer
from robot_dyn.simulation.samples import row
from robot_dyn.simulation.setup import Setup
from robot_dyn.simulation.trajectory import Ending, Outcome

MOST_SHARED = 200_000  # states of a run that are compared with those of its companions


@final
@dataclass(frozen=True)
class Path:
    """States on the way, k of them.

    Attributes:
        key: Steps of the run before each, (k,), by which the states of a run and of its companions are matched.
        t: In [s], (k,).
        y: States of the motion, (k, m).
    """

    key: np.ndarray
    t: np.ndarray
    y: np.ndarray


@final
@dataclass(frozen=True, eq=False)
class Record:
    """The states of a run.

    Attributes:
        outcome: How it ended.
        t: Of the samples, (k,), in [s].
        y: States of the motion, (k, m).
        held: What a sampled controller holds, (k, n); None for any other.
        rows: What follows from them, side by side as of `samples.row`; None where machine code gives it.
        shared: States at which runs of other steps are compared.
        walked: States at the ends of all steps; the same, unless the method chooses its steps.
        steps: Number of steps.
        evaluations: Of the equation of motion.
    """

    outcome: Outcome
    t: np.ndarray
    y: np.ndarray
    held: np.ndarray | None
    rows: np.ndarray | None
    shared: Path
    walked: Path
    steps: int
    evaluations: int


def collect(
    setup: Setup,
    motion: Motion,
    pace: Fraction,
    thin: int,
    systems: Systems | None = None,
    on_progress: Callable[[float], object] | None = None,
    observer: Observer | None = None,
) -> Record:
    """March in Python; keep samples at the record period, and positions at the times that companions share.

    Args:
        setup: What to run.
        motion: Its equation of motion.
        pace: Length of a step, in steps of the setup; 1 keeps samples.
        thin: Steps of the run between the states of `Record.shared`.
        systems: As of `march`.
        on_progress: Called with the time reached at each step.
        observer: Sees each step.
    """
    kept = _Kept(motion, derived=systems is None)
    counter, shared, walked = Counter(observer), list[Sample](), list[Sample]()
    start = motion.start(setup.q0, setup.v0)
    if observer is not None:
        systems = partial(systems or motion.system, seen=observer.seen)
    next_record, t = 0.0, 0.0
    try:
        with np.errstate(all="ignore"):  # what overflows ends the march
            for sample in march(setup, motion, pace, counter, systems):
                t, last = sample.t, sample.t == setup.duration_s
                if sample.kept and pace == 1 and (t >= next_record - 1e-9 * setup.step_s or last):
                    kept.add(sample)
                    next_record += setup.record_period_s
                if not sample.kept and sample.key < 0 and len(walked) < MOST_SHARED:
                    walked.append(sample)
                if sample.key >= 0 and (sample.key % thin == 0 or last):
                    shared.append(sample)
                if on_progress is not None:
                    on_progress(t)
        outcome = Outcome(Ending.FINISHED, t)
    except DivergedError as end:
        outcome = Outcome(Ending.DIVERGED, end.t, str(end))
    except KeyboardInterrupt:
        outcome = Outcome(Ending.STOPPED, t, "interrupted; all samples up to here are kept")
    if pace == 1 and not kept.numbers:  # interrupted, or without a tick, at once
        kept.add(Sample(0.0, start, np.full_like(setup.q0, np.nan) if motion.sampled else None))
    return Record(
        outcome, *kept.columns(len(start)),
        _path(shared), _path(sorted([*walked, *shared], key=_time) if walked else shared),
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


def _time(sample: Sample) -> float:
    return sample.t


def _path(samples: list[Sample]) -> Path:
    if not samples:
        return Path(np.empty(0, np.int64), np.empty(0), np.empty((0, 0)))
    key, t = np.array([sample.key for sample in samples], np.int64), np.array([sample.t for sample in samples])
    return Path(key, t, np.array([sample.y for sample in samples]))
