"""Run files: one .npz that holds a trajectory, or the runs of a batch, with its robot, scene and versions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from robot_dyn.foundations.errors import RobotDynError, shorten
from robot_dyn.foundations.files import FileKind, file_path
from robot_dyn.foundations.store import Found, StoredFormat, StoreError
from robot_dyn.simulation.results.provenance import packed, unpacked
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.setup.setup import LONGEST_S

FORMAT = 9
ROLLOUTS_FORMAT = "rollouts 6"
RUN = FileKind("a run file", ".npz", b"PK\x03\x04")


class RunFileError(RobotDynError):
    """A run file that cannot be written or read."""


def save_run(trajectory: Trajectory, path: str | Path) -> Path:
    """Write a trajectory to `path` (.npz is added if it has no suffix), whole or not at all.

    Another run file under that name is replaced; a file of another kind is not.

    Raises:
        RunFileError: If it cannot be written.
    """
    if not isinstance(trajectory, Trajectory):
        kind = type(trajectory).__name__
        raise RunFileError(f"save_run takes the Trajectory of rd.simulate, got {kind}; save_rollouts takes Rollouts")
    about = packed(trajectory.about, file_path(path, RunFileError).parent)
    return _RUN.save(replace(trajectory, about=about), path)


def load_run(path: str | Path) -> Trajectory:
    """Return the trajectory of a run file.

    Raises:
        RunFileError: If it is missing, damaged, cut short or of another format.
    """
    run = _RUN.load(path)
    return replace(run, about=unpacked(run.about, Path(path)))


def reader_of(about: Mapping[str, object]) -> str:
    """Return the reader for a run file of another format, from its JSON."""
    if about["format"] == ROLLOUTS_FORMAT:
        return (
            "it is a file of rollouts, which are many runs: rd.load_rollouts reads it, and rd.save_run writes one of"
            " them, for example rd.load_rollouts(…)[0], to a run file"
        )
    if about["format"] == FORMAT:
        return "it is a file of one run, not of rollouts: rd.load_run reads it"
    value = about.get("value", about)  # formats up to 6 have the texts outside
    texts = value.get("about") if isinstance(value, dict) else None
    versions = texts.get("versions") if isinstance(texts, dict) else None
    return f"read it with the version that wrote it: {shorten(str(versions or 'unknown'))}"


def _check(run: Trajectory, found: Found) -> None:
    """Raise a StoreError if the arrays of a run do not fit together, or its numbers cannot be those of a run."""
    if found.lengths["n"] != len(run.joint_names):
        raise StoreError(f"'q' is of {found.lengths['n']} joints, 'joint_names' of {len(run.joint_names)}")
    if found.not_finite and run.outcome.ending is not Ending.DIVERGED:
        raise StoreError(f"member {shorten(found.not_finite[0])!r} of a run that did not diverge holds nan or inf")
    for name, t in (("t", run.t), *((f"wrenches/{link}", F[:, 0]) for link, F in run.wrenches.items())):
        if not are_times(t) or len(t) < len(run.t):
            raise StoreError(f"the times of member {shorten(name)!r} are not those of a run, or do not grow")
    if run.error is not None and not are_times(run.error.t):
        raise StoreError("the times of member 'error/t' are not those of a run, or do not grow")
    if run.power.keys() != run.ledger.work.keys():
        raise StoreError("members of 'power' and of the ledger's 'work' have different names")
    if run.desired is not None and run.tracking_error is not None and run.tracking_error.shape != run.desired.shape:
        raise StoreError("members 'desired' and 'tracking_error' differ in shape")
    if run.desired is None and run.tracking_error is not None and run.tracking_error.shape[1] != 3:
        raise StoreError("member 'tracking_error' of joints needs 'desired', which is missing")
    if not are_times(np.array([run.outcome.t])):
        raise StoreError(f"'outcome/t' holds {run.outcome.t!r}, not a time in [s]")


def are_times(t: np.ndarray) -> bool:
    """Return True if these can be times of a run: as long as one can be, and none before the last."""
    return bool(np.all((t >= 0) & (t <= LONGEST_S)) and np.all(t[1:] >= t[:-1]))


_RUN = StoredFormat(
    FORMAT, Trajectory, RUN, RunFileError, "write one with robot-dyn simulate … -o run.npz", _check, reader_of
)
