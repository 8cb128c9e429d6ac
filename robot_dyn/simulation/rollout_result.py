"""The trajectories of a batch of rollouts: arrays over runs and samples, and an outcome for each run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from robot_dyn.simulation.trajectory import Ending, Outcome

_REASONS = ("", "a number overflowed", "energy grows without a source")


@final
@dataclass(frozen=True, eq=False)
class Rollouts:
    """B runs, m samples of each. Samples after a run diverged are nan. What was not recorded is None.

    Attributes:
        joint_names: Of the n joints.
        t: In [s], (m,).
        q, v: In [rad] and [rad/s], or [m] and [m/s], (B, m, n).
        tau: Actuation within its bounds, (B, m, n), in [N m] or [N].
        kinetic, potential: Energies, (B, m), in [J].
        work: Done up to each sample by the control and by each other effect, by name, (B, m), in [J].
        ended: When each run ended, (B,), in [s].
        diverged: Whether it ended before its time, (B,).
        stopped: Whether it was interrupted, (B,).
    """

    joint_names: tuple[str, ...]
    t: np.ndarray
    q: np.ndarray | None
    v: np.ndarray | None
    tau: np.ndarray | None
    kinetic: np.ndarray | None
    potential: np.ndarray | None
    work: dict[str, np.ndarray] | None
    ended: np.ndarray
    diverged: np.ndarray
    stopped: np.ndarray
    reasons: np.ndarray

    def __len__(self) -> int:
        return len(self.ended)

    def outcome(self, run: int) -> Outcome:
        """How a run ended."""
        if self.stopped[run]:
            return Outcome(Ending.STOPPED, float(self.ended[run]), "interrupted")
        if not self.diverged[run]:
            return Outcome(Ending.FINISHED, float(self.ended[run]))
        advice = f"{_REASONS[int(self.reasons[run])]}: simulate it by itself for more; take a smaller step"
        return Outcome(Ending.DIVERGED, float(self.ended[run]), advice)

    @property
    def summary(self) -> str:
        """One line: how many runs, and how many of them ended before their time."""
        early = f"{int(self.diverged.sum())} diverged, {int(self.stopped.sum())} stopped"
        return f"{len(self)} runs of {len(self.t)} samples to t = {self.t[-1]:g} s; {early}"
