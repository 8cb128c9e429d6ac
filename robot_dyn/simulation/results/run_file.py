"""Run files: a trajectory as one .npz file, with its robot, scene and versions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np

from robot_dyn.foundations.errors import RobotDynError, shorten
from robot_dyn.foundations.files import FileKind
from robot_dyn.foundations.store import Members, StoredFormat, StoreError
from robot_dyn.simulation.results.provenance import packed
from robot_dyn.simulation.results.run_data import TrajectoryData
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.setup.setup import LONGEST_S

FORMAT = 10
RUN = FileKind("a run file", ".npz", b"PK\x03\x04")
REMEDY = "write one with run.save('run.npz') or robot-dyn simulate … -o run.npz"


Run = TypeVar("Run", bound=TrajectoryData)


class RunFileError(RobotDynError):
    """A run file that cannot be written or read."""


def write_run(run: TrajectoryData, path: Path) -> Path:
    """Write a run as a run file, completely or not at all; raise a RunFileError if that fails."""
    return run_format(type(run)).save(replace(run, metadata=packed(run.metadata, path.parent)), path)


def version_remedy(header: Mapping[str, object]) -> str:
    """Return the remedy for a run file of another format, from its JSON."""
    value = header.get("value", header)  # in formats up to 6 the texts are outside; "about" up to 9
    texts = value.get("metadata", value.get("about")) if isinstance(value, dict) else None
    versions = texts.get("versions") if isinstance(texts, dict) else None
    return f"read it with the version that wrote it: {shorten(str(versions or 'unknown'))}"


def _check(run: TrajectoryData, members: Members) -> None:
    """Raise a StoreError if the arrays of a run are inconsistent, or their numbers cannot belong to a run."""
    if members.lengths["n"] != len(run.joint_names):
        raise StoreError(f"'q' has {members.lengths['n']} joints, but 'joint_names' has {len(run.joint_names)}")
    if members.not_finite and run.outcome.ending is not Ending.DIVERGED:
        raise StoreError(f"member {shorten(members.not_finite[0])!r} of a run that did not diverge contains nan or inf")
    for name, t in (("t", run.t), *((f"wrenches/{link}", F[:, 0]) for link, F in run.wrenches.items())):
        if not are_times(t) or len(t) < len(run.t):
            raise StoreError(f"the times of member {shorten(name)!r} are too few, negative, too large or decreasing")
    if run.error is not None and not are_times(run.error.t):
        raise StoreError("the times of member 'error/t' are negative, too large or decreasing")
    if run.power.keys() != run.ledger.work.keys():
        raise StoreError("members of 'power' and of the ledger's 'work' have different names")
    if run.desired is not None and run.tracking_error is not None and run.tracking_error.shape != run.desired.shape:
        raise StoreError("members 'desired' and 'tracking_error' differ in shape")
    if run.desired is None and run.tracking_error is not None and run.tracking_error.shape[1] != 3:
        raise StoreError("member 'tracking_error' of joints needs 'desired', which is missing")
    if not are_times(np.array([run.outcome.t])):
        raise StoreError(f"'outcome/t' is {run.outcome.t!r}, which is not a time in [s]")


def are_times(t: np.ndarray) -> bool:
    """Return True if these can be times of a run: not negative, not decreasing, at most `LONGEST_S`."""
    return bool(np.all((t >= 0) & (t <= LONGEST_S)) and np.all(t[1:] >= t[:-1]))


@cache
def run_format(run_type: type[Run]) -> StoredFormat[Run]:
    """Return the format of run files for a class of runs."""
    return StoredFormat(FORMAT, run_type, RUN, RunFileError, REMEDY, _check, version_remedy)
