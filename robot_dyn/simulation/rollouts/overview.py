"""Overview of a batch: remarks with counts, tracking errors, and the run to examine first."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from robot_dyn.effects.dry_friction import DryFriction
from robot_dyn.foundations.coefficients import with_values
from robot_dyn.queries.units import joint_types_of
from robot_dyn.simulation.diagnostics.reference_remarks import Units, at_rest, held_by_friction, jumps
from robot_dyn.simulation.diagnostics.step_remarks import (
    QUANTITIES,
    Remedy,
    against,
    of_reference,
    of_run,
    of_runs,
    units_of,
)
from robot_dyn.simulation.diagnostics.unstable_loop import unstable
from robot_dyn.simulation.observation.remarks import Facts, Remark, RemarkKind
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.simulation.results.samples import root_mean_square, tracking_of
from robot_dyn.simulation.rollouts.rollouts_data import Overview, RolloutsData, states_of
from robot_dyn.simulation.setup.setup import Setup

OF_REFERENCES = RemarkKind.JUMPS, RemarkKind.HELD


def overview(runs: RolloutsData) -> Overview:
    """Return the overview of runs with their setup."""

    def remedy(run: int, start: float) -> Facts:
        setup = runs.setup_of(run)
        return against(setup, runs.t, np.tile(setup.q0, (len(runs.t), 1)) if runs.q is None else runs.q[run], start)

    errors, remarks = rms_tracking_errors(runs), tuple(_remarks(runs, remedy))
    worst = worst_of(runs, remarks, errors)
    return Overview(worst, (*remarks, *_linearised(runs, worst)), errors)


def remarks_on_each(runs: RolloutsData) -> tuple[Remark, ...]:
    """Return the remarks that do not depend on the other runs of the batch, without remedies.

    Their order, by kind, quantity and joint, does not depend on the other runs either.
    """
    kinds = list(RemarkKind)

    def place(remark: Remark) -> tuple[int, int, int]:
        joint = runs.joint_names.index(remark.joint)
        return kinds.index(remark.kind), QUANTITIES.index(remark.quantity), joint

    return tuple(sorted(_remarks(runs, lambda *_: {}), key=place))


def _remarks(runs: RolloutsData, remedy: Remedy) -> Iterator[Remark]:
    """Yield remarks on observations and on the reference, with a remedy for the chatter of a run."""
    yield from _counted(runs, remedy)
    if runs.setup is not None:
        yield from _of_references(runs, runs.setup)


def texts_by_run(remarks: Iterable[Remark], count: int) -> list[str]:
    """Return kind, quantity and joint of the remarks on each run, "effort_limit_reached u elbow"; empty for none."""
    of_run: list[list[str]] = [[] for _ in range(count)]
    for remark in remarks:
        for run in remark.runs:
            of_run[run].append(f"{remark.kind} {remark.quantity} {remark.joint}")
    return ["; ".join(texts) for texts in of_run]


def of_some(runs: RolloutsData, numbers: range, whole: Overview) -> Overview:
    """Return the overview of runs without their setup, which have these numbers in a larger batch."""
    errors = None if whole.rms_tracking_error is None else whole.rms_tracking_error[numbers]
    facts = {remark.kind: remark.facts for remark in whole.remarks}
    remarks = *_counted(runs, lambda *_: facts[RemarkKind.CHATTER]), *_of_whole(whole, numbers)
    alone = (remark for remark in whole.remarks if remark.looked == 1 != len(numbers) and remark.runs[0] in numbers)
    remarks += tuple(replace(remark, runs=(numbers.index(remark.runs[0]),)) for remark in alone)
    return Overview(worst_of(runs, remarks, errors), remarks, errors)


def remarks_of(runs: RolloutsData, run: int, setup: Setup | None, t: np.ndarray, q: np.ndarray) -> tuple[Remark, ...]:
    """Return the remarks on the observations of one run, with positions q (m, n) at times t (m,)."""

    def remedy(_: int, start: float) -> Facts:
        return {} if setup is None else against(setup, t, q, start)

    remarks = of_run(runs.joint_names, units(runs), runs.observed[run : run + 1], remedy)
    if setup is not None:
        remarks += of_reference(setup, t, runs.observed.extremes[run], units(runs))
    elif runs.saved is not None:
        whole = _of_whole(runs.saved, range(run, run + 1))
        remarks += (replace(remark, runs=(), looked=0) for remark in whole)
    return tuple(remarks)


def _of_whole(whole: Overview, numbers: range) -> Iterator[Remark]:
    """Yield remarks on the reference of some runs of a batch without their setup; the text may be about another run."""
    for remark in whole.remarks:
        affected = tuple(numbers.index(run) for run in remark.runs if run in numbers)
        if affected and remark.kind in OF_REFERENCES:
            elsewhere = {} if remark.runs[0] in numbers else {"elsewhere": "in another run"}
            yield replace(remark, runs=affected, looked=len(numbers), facts=remark.facts | elsewhere)


def units(runs: RolloutsData) -> Units:
    """Return the units of q, v and u of each joint."""
    return units_of(joint_types(runs) if runs.setup is None else joint_types_of(runs.setup.plant.dynamics))


def _counted(runs: RolloutsData, remedy: Remedy) -> Iterator[Remark]:
    """Yield, for each kind, joint and quantity, the remark on the worst run, with the numbers of the affected runs."""
    for remark, worst, some in of_runs(runs.joint_names, units(runs), runs.observed, remedy):
        yield _in_runs(remark, worst, some)


def _of_references(runs: RolloutsData, setup: Setup) -> Iterator[Remark]:
    """Yield remarks on the common reference: jumps from the starts of runs, and joints that friction holds."""
    for remark, gaps in jumps(setup, runs.q0, runs.v0, units(runs)):
        yield _in_runs(remark, int(gaps.argmax()), gaps > 0)
    if not any(isinstance(effect, DryFriction) for effect in setup.plant.effects):
        return
    extremes, by_joint = runs.observed.extremes, dict[str, list[tuple[int, Remark]]]()
    for run in map(int, np.flatnonzero(at_rest(extremes).any(axis=1))):
        of_run = with_values(setup, runs._of_run(setup, run))
        for remark in held_by_friction(of_run, extremes[run], runs.t[runs.t <= runs.ended_s[run]], units(runs)):
            by_joint.setdefault(remark.joint, []).append((run, remark))
    for pairs in by_joint.values():
        worst, remark = max(pairs, key=lambda pair: pair[1].limit or 0.0)
        yield _in_runs(remark, worst, np.isin(np.arange(len(runs)), [run for run, _ in pairs]))


def _in_runs(remark: Remark, worst: int, some: np.ndarray) -> Remark:
    """Return a remark on the worst run as a remark on some runs (B,) of a batch."""
    numbers = (int(run) for run in np.flatnonzero(some) if run != worst)
    return replace(remark, runs=(worst, *numbers), looked=len(some))


def _linearised(runs: RolloutsData, run: int) -> Iterator[Remark]:
    """Yield the remark on the sampled loop of one run."""
    setup = runs.setup_of(run)
    for remark in unstable(setup, *states_of(runs, run, setup), bool(runs.diverged[run]), end=runs.ends[run].t):
        yield replace(remark, runs=(run,), looked=1)


def worst_of(runs: RolloutsData, remarks: tuple[Remark, ...], errors: np.ndarray | None) -> int:
    """Return the number of the run to examine first, see `Rollouts.worst`."""
    if runs.diverged.any():
        return int(np.where(runs.diverged, runs.ended_s, np.inf).argmin())
    for remark in remarks:
        if remark.kind is RemarkKind.CHATTER:
            return remark.runs[0]
    beyond = [remark for remark in remarks if remark.kind is RemarkKind.BEYOND and remark.limit]
    if beyond:
        return max(beyond, key=lambda remark: abs(remark.value / (remark.limit or 1.0) - 1)).runs[0]
    return 0 if errors is None or np.isnan(errors).all() else int(np.nanargmax(errors))


def rms_tracking_errors(runs: RolloutsData) -> np.ndarray | None:
    """Return the rms tracking error of each run, see `Rollouts`; nan for a run that did not begin."""
    if runs.q is None or runs.setup is None or runs.setup.controller is None:
        return None
    finite = np.isfinite(runs.q.sum(axis=2))
    q = np.where(finite[..., None], runs.q, 0.0)
    errors = tracking_of(runs.setup, runs.t, q).tracking_error
    if errors is None:
        return None
    return np.array(
        [root_mean_square(x[rows]) if rows.any() else np.nan for x, rows in zip(errors, finite, strict=True)]
    )
