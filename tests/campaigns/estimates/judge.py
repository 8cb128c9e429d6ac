"""The judgement of an estimate: what it said, what is true, and whether it said so in silence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import robot_dyn as rd
from tests.campaigns.estimates.scenes import Scene, scene
from tests.campaigns.estimates.truth import truth

LEAST = 0.3  # an estimate below this part of the true error misleads
MOST = 3.0  # an estimate beyond this multiple of it is of little use
FAR = 10.0  # one beyond this multiple of it, of which the order is said to be seen, is wrong

Truth = Callable[[rd.Setup, np.ndarray], np.ndarray]  # positions of a setup at times


@dataclass(frozen=True)
class Judgement:
    """What came of a scene.

    Attributes:
        scene: The scene.
        run: Its trajectory.
        true: Largest error of q up to where the estimate holds.
        true_at_end: The same up to the end of the run.
        unsure: Error of the truth itself; 0 where the estimate is near the true error whatever it is.
    """

    scene: Scene
    run: rd.Trajectory
    true: float
    true_at_end: float
    unsure: float

    @property
    def silent(self) -> bool:
        """Whether nothing but the estimate warns: finished, no note, ledger closed."""
        run = self.run
        return run.outcome.ending == "finished" and not run.error.note and "does not close" not in run.summary

    @property
    def floor(self) -> float:
        """Below it neither truth nor run can tell: rounding of q in 4500 steps."""
        return 1e-12 * (1 + float(np.abs(self.run.q).max())) + self.unsure

    @property
    def ratio(self) -> float:
        """Estimate over true error, both at least the floor."""
        return max(self.run.error.at(self.run.error.until_s), self.floor) / max(self.true, self.floor)

    @property
    def misleads(self) -> bool:
        return self.silent and not self.ratio >= LEAST

    @property
    def usable(self) -> bool:
        """Whether the run is accurate enough to be of use."""
        return self.run.outcome.ending == "finished" and self.true_at_end < 1e-3

    def __str__(self) -> str:
        error = self.run.error
        return f"{self.scene.label}: {error} | true {self.true:.1e} ratio {self.ratio:.2g}"


def judge(seed: int, index: int, of: Callable[[int, int], Scene] = scene) -> Judgement:
    return judged(of(seed, index), truth, lambda setup, t: truth(setup, t, 2e-13, 3e-3))


def judged(made: Scene, exact: Truth, witness: Truth) -> Judgement:
    """Run a scene, its truth, and another, whose distance from that one tells how sure it is, where it matters."""
    run = rd.simulate(made.setup)
    q = exact(made.setup, run.t)
    errors = np.maximum.accumulate(np.abs(run.q - q).max(axis=1))
    known = run.t <= run.error.until_s
    true = float(errors[known][-1]) if known.any() else 0.0
    found = Judgement(made, run, true, float(errors[-1]), 0.0)
    if not known.any() or LEAST <= found.ratio <= MOST:  # a floor moves the ratio towards 1
        return found
    return replace(found, unsure=float(np.abs(q - witness(made.setup, run.t))[known].max()))
