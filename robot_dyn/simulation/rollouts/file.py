"""Files of rollouts: one .npz with the recorded arrays of all runs, in the form of a run file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from robot_dyn.foundations.files import file_path
from robot_dyn.foundations.store import Found, StoredFormat, StoreError
from robot_dyn.simulation.results.provenance import packed, unpacked
from robot_dyn.simulation.results.run_file import ROLLOUTS_FORMAT, RUN, RunFileError, are_times, reader_of
from robot_dyn.simulation.rollouts.result import Rollouts


def save_rollouts(runs: Rollouts, path: str | Path) -> Path:
    """Write rollouts to `path` (.npz is added if it has no suffix), whole or not at all; without their setup.

    Another run file under that name is replaced; a file of another kind is not.

    Raises:
        RunFileError: If it cannot be written.
    """
    if not isinstance(runs, Rollouts):
        raise RunFileError(f"save_rollouts takes the Rollouts of rd.rollouts, got {type(runs).__name__}")
    about = packed(runs.about, file_path(path, RunFileError).parent)
    return _ROLLOUTS.save(
        replace(runs, about=about, ends=runs.outcomes, saved=runs.overview, setup=None, numbers=None), path
    )


def load_rollouts(path: str | Path) -> Rollouts:
    """Return the rollouts of a file; `setup` is None.

    Raises:
        RunFileError: If it is missing, damaged, cut short or of another format.
    """
    runs = _ROLLOUTS.load(path)
    return replace(runs, about=unpacked(runs.about, Path(path)))


def _check(runs: Rollouts, found: Found) -> None:
    """Raise a StoreError if the arrays of rollouts do not fit together, or cannot be those of runs."""
    if found.lengths.get("n", len(runs.joint_names)) != len(runs.joint_names):
        raise StoreError(f"arrays are of {found.lengths['n']} joints, 'joint_names' of {len(runs.joint_names)}")
    if not are_times(runs.t) or not len(runs.t):
        raise StoreError("the times of member 't' are not finite, or do not grow")
    if not all(map(are_times, runs.ended[:, None])):
        raise StoreError("the times in 'ends' are not those of runs")
    numbered = (number for remark in (() if runs.saved is None else runs.saved.remarks) for number in remark.runs)
    if len(runs.observed.levels) != runs.observed.limits.shape[1]:
        raise StoreError("'observed/levels' are not those of member 'observed/limits'")
    if not all(0 <= number < len(runs) for number in (*numbered, 0 if runs.saved is None else runs.saved.worst)):
        raise StoreError(f"'saved' is about a run that is not one of the {len(runs)}")
    if len(runs.ends) != len(runs.q0):
        raise StoreError(f"'ends' is of {len(runs.ends)} runs, not of {len(runs.q0)}")
    if runs.work is not None and set(runs.work) != set(runs.sources):
        raise StoreError("members 'work/…' and 'sources' have different names")
    whole = ~(runs.diverged | runs.stopped)[:, None] & (
        (runs.t < runs.ended[:, None]) | (runs.ended >= runs.t[-1])[:, None]
    )
    for name in ("q", "v", "u", "kinetic", "potential"):
        array = getattr(runs, name)
        if array is not None and not np.isfinite(array[whole]).all():
            raise StoreError(f"member {name!r} of a run that did not diverge holds nan or inf")


_ROLLOUTS = StoredFormat(
    ROLLOUTS_FORMAT, Rollouts, RUN, RunFileError, "write one with rd.save_rollouts", _check, reader_of
)
