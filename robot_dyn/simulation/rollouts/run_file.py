"""Run files of batches: the recorded arrays of all runs as one .npz file."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np

from robot_dyn.foundations.store import Members, StoredFormat, StoreError
from robot_dyn.simulation.results.provenance import packed
from robot_dyn.simulation.results.run_file import REMEDY, RUN, RunFileError, are_times, version_remedy
from robot_dyn.simulation.rollouts.rollouts_data import Overview, RolloutsData

FORMAT = "rollouts 8"

Runs = TypeVar("Runs", bound=RolloutsData)


def write_rollouts(runs: RolloutsData, path: Path, overview: Overview) -> Path:
    """Write rollouts as a run file, completely or not at all; raise a RunFileError if that fails."""
    metadata = packed(runs.metadata, path.parent)
    return rollouts_format(type(runs)).save(
        replace(runs, metadata=metadata, ends=runs.outcomes, saved=overview, setup=None, numbers=None), path
    )


def _check(runs: RolloutsData, members: Members) -> None:
    """Raise a StoreError if the arrays of rollouts are inconsistent, or their values are impossible for runs."""
    if members.lengths.get("n", len(runs.joint_names)) != len(runs.joint_names):
        raise StoreError(f"arrays have {members.lengths['n']} joints, 'joint_names' has {len(runs.joint_names)}")
    if not are_times(runs.t) or not len(runs.t):
        raise StoreError("the times of member 't' are missing, negative, too large or decreasing")
    if not all(map(are_times, runs.ended_s[:, None])):
        raise StoreError("a time in 'ends' is negative, too large or not finite")
    run_numbers = (number for remark in (() if runs.saved is None else runs.saved.remarks) for number in remark.runs)
    if len(runs.observed.levels) != runs.observed.limits.shape[1]:
        raise StoreError("members 'observed/levels' and 'observed/limits' have different lengths")
    if not all(0 <= number < len(runs) for number in (*run_numbers, 0 if runs.saved is None else runs.saved.worst)):
        raise StoreError(f"'saved' names a run outside 0 to {len(runs) - 1}")
    if len(runs.ends) != len(runs.q0):
        raise StoreError(f"'ends' has {len(runs.ends)} runs, 'q0' has {len(runs.q0)}")
    if runs.work is not None and set(runs.work) != set(runs.sources):
        raise StoreError("members 'work/…' and 'sources' have different names")
    is_complete = ~(runs.diverged | runs.stopped)[:, None] & (
        (runs.t < runs.ended_s[:, None]) | (runs.ended_s >= runs.t[-1])[:, None]
    )
    for name in ("q", "v", "u", "kinetic", "potential"):
        array = getattr(runs, name)
        if array is not None and not np.isfinite(array[is_complete]).all():
            raise StoreError(f"member {name!r} of a run that did not diverge contains nan or inf")


@cache
def rollouts_format(runs_type: type[Runs]) -> StoredFormat[Runs]:
    """Return the format of run files for a class of batches."""
    return StoredFormat(FORMAT, runs_type, RUN, RunFileError, REMEDY, _check, version_remedy)
