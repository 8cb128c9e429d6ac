"""Each run of a batch beside the run of `simulate`, to rounding × growth.

|x_batch − x_simulate| ≤ MOST (max |x_pushed − x_simulate| + ε max |x|)   for q and v at all samples

A pushed run starts a few units of rounding beside the other: what it departs by is how far the motion, its events and
its controller carry rounding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import robot_dyn as rd
from robot_dyn.codegen.parameters import with_parameters
from robot_dyn.simulation import Remark, RemarkKind
from robot_dyn.simulation.diagnostics.step_remarks import KINDS
from tests.campaigns.batches.scenes import Batch, batch

UNITS = 8  # of rounding, by which a start is pushed
MOST = 100.0  # some thousand steps round, in two engines that sum in other orders, where a push is one rounding


@dataclass(frozen=True)
class Judged:
    """What came of a batch: the largest ratio to what rounding explains, and what else differs, in words."""

    batch: Batch
    runs: rd.Rollouts
    ratio: float
    differs: tuple[str, ...]

    @property
    def alike(self) -> bool:
        return not self.differs and self.ratio <= MOST

    def __str__(self) -> str:
        return (
            f"{self.batch.label}: ratio {self.ratio:.2g}; {'; '.join([*self.differs, ''])}{self.runs.statistics.engine}"
        )


def judge(seed: int, index: int) -> Judged:
    """Batch number `index` of a seed, run and compared."""
    given = batch(seed, index)
    runs = rd.rollouts(given.setup, given.q0, given.v0, vary=given.params, record=("q", "v"), threads=2)
    ratio, differs = 0.0, []
    for i in range(len(runs)):
        own = alone(given, i)
        one = rd.simulate(own)
        differs += [f"run {i}: {each}" for each in differences(runs, i, one)]
        if not differs and one.outcome.ending != "diverged":
            ratio = max(ratio, *(_ratio(getattr(runs, name)[i], one, pushed(own), name) for name in ("q", "v")))
    return Judged(given, runs, ratio, tuple(differs))


def alone(given: Batch, run: int) -> rd.Setup:
    """The setup of a run, with its own start, values and noise; the first is interpreted, if its steps are fixed."""
    rows = {name: x[run] for name, x in given.params.items()}
    plant, controller = with_parameters(given.setup.plant, given.setup.controller, rows)
    controller = None if controller is None else controller.of_run(run)
    engine = "compiled" if run or given.setup.method.controls_error else "interpreted"
    return replace(given.setup, plant=plant, controller=controller, q0=given.q0[run], v0=given.v0[run], engine=engine)


def differences(runs: rd.Rollouts, run: int, one: rd.Trajectory) -> list[str]:
    """What is to be alike but for rounding of times, and is not."""
    found, ours = [], runs.outcome(run)
    if ours.ending != one.outcome.ending or abs(ours.t - one.outcome.t) > 1e-9:
        found.append(f"{ours} for {one.outcome}")
    known = np.isfinite(runs.q[run]).all(axis=1).sum()  # type: ignore[index]
    if known != len(one.t) or np.abs(runs.t[:known] - one.t).max() > 1e-12:
        found.append(f"{known} samples to {runs.t[known - 1]!r} s for {len(one.t)} to {one.t[-1]!r} s")
    if runs.steps[run] != one.statistics.steps:
        found.append(f"{runs.steps[run]} steps for {one.statistics.steps}")
    ours = {about(each) for each in runs.remarks if run in each.runs and counted(runs, each)}
    theirs = {about(each) for each in one.remarks if counted(runs, each)}
    if ours != theirs and one.outcome.ending != "diverged":
        found.append(f"remarks {sorted(ours - theirs)} and not {sorted(theirs - ours)}")
    return found


def about(remark: Remark) -> tuple[str, str, str]:
    return str(remark.kind), remark.joint, remark.quantity


def counted(runs: rd.Rollouts, remark: Remark) -> bool:
    """Whether a remark is one that is made on each run of a batch as well; an actuation may be seen at instants."""
    observed = runs.observed
    at_instants = remark.quantity == "u" and observed is not None and observed.instants.any()
    return remark.kind in (*KINDS, RemarkKind.CHATTER, RemarkKind.JUMPS, RemarkKind.HELD) and not at_instants


def pushed(setup: rd.Setup) -> list[rd.Trajectory]:
    """The run of starts pushed in both directions."""
    signs = np.where(np.arange(len(setup.q0)) % 2, 1.0, -1.0)
    pushes = [UNITS * way * signs * np.spacing(1.0) for way in (1, -1)]
    return [rd.simulate(setup, q0=setup.q0 + each, v0=setup.v0 + each, engine="compiled") for each in pushes]


def _ratio(ours: np.ndarray, one: rd.Trajectory, others: list[rd.Trajectory], name: str) -> float:
    theirs = getattr(one, name)
    size = np.spacing(max(1.0, np.abs(theirs).max()))
    grown = max((np.abs(getattr(each, name) - theirs).max() for each in others if len(each.t) == len(one.t)), default=0)
    return float(np.abs(ours[: len(theirs)] - theirs).max() / (grown + size))
