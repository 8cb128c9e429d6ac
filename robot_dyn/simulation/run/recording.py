"""What a time loop leaves behind: samples at t = 0, T, 2 T, …, and the states that companion runs share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from robot_dyn.simulation.events.occurrence import Occurrence
from robot_dyn.simulation.run.outcome import Outcome

MOST_SHARED = 200_000  # states of a run that are compared with those of its companions


@final
@dataclass(frozen=True)
class Path:
    """States on the way, k of them.

    Attributes:
        key: Steps of the run before each, (k,), by which the states of a run and of its companions are matched.
        t: In [s], (k,).
        y: States of the state equation, (k, m).
    """

    key: np.ndarray
    t: np.ndarray
    y: np.ndarray


@final
@dataclass(frozen=True, eq=False)
class Recording:
    """The states of a run.

    Attributes:
        outcome: How it ended.
        t: Of the samples, (k,), in [s].
        y: States of the state equation, (k, m).
        made: What follows from them: y', u, K and V, (k, m + n + 2).
        shared: States at which runs of other steps are compared.
        step_log: States at the ends of all steps; the same, unless the method chooses its steps.
        steps: Number of steps.
        evaluations: Of the equation of motion.
        kinetic_peak: Largest kinetic energy that is known, beside that of the samples, in [J].
        events: That occurred.
        ends: Of the steps, in [s], where the method chooses them; None for any other.
    """

    outcome: Outcome
    t: np.ndarray
    y: np.ndarray
    made: np.ndarray
    shared: Path
    step_log: Path
    steps: int
    evaluations: int
    kinetic_peak: float
    events: tuple[Occurrence, ...] = ()
    ends: np.ndarray | None = None
