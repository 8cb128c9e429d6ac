"""Files of rollouts: one .npz that holds the recorded arrays of all runs, in the manner of a run file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from robot_dyn.simulation.results.archive import ArchiveError
from robot_dyn.simulation.results.run_file import MAX_BYTES, ROLLOUTS_FORMAT, Format, RunFileError, are_times
from robot_dyn.simulation.rollouts.result import Rollouts


def save_rollouts(runs: Rollouts, path: str | Path) -> Path:
    """Write rollouts to `path` (.npz is added if it has no suffix), whole or not at all; without their setup.

    Another run file under that name is replaced; a file of another kind is not.

    Raises:
        RunFileError: If it cannot be written.
    """
    if not isinstance(runs, Rollouts):
        raise RunFileError(f"save_rollouts takes the Rollouts of rd.rollouts, got {type(runs).__name__}")
    return _ROLLOUTS.write(replace(runs, saved=runs.overview), path)


def load_rollouts(path: str | Path, *, max_bytes: int = MAX_BYTES) -> Rollouts:
    """The rollouts of a file; `setup` is None.

    Args:
        path: Of the file.
        max_bytes: The largest size of its arrays that is read.

    Raises:
        RunFileError: If it is missing, damaged, cut short, larger, of another format, or was changed.
    """
    return _ROLLOUTS.read(path, max_bytes)


def _check(runs: Rollouts) -> None:
    """That the arrays of rollouts fit together, and their numbers can be those of runs."""
    if not are_times(runs.t) or not len(runs.t):
        raise ArchiveError("the times of member 't' are not finite, or do not grow")
    if not all(map(are_times, runs.ended[:, None])) or (runs.diverged & runs.stopped).any():
        raise ArchiveError("members 'ended', 'diverged' and 'stopped' are not those of runs")
    numbered = (number for each in (() if runs.saved is None else runs.saved.remarks) for number in each.runs)
    if runs.observed is not None and len(runs.observed.levels) != runs.observed.limits.shape[1]:
        raise ArchiveError("'observed/levels' are not those of member 'observed/limits'")
    if not all(0 <= number < len(runs) for number in (*numbered, 0 if runs.saved is None else runs.saved.worst)):
        raise ArchiveError(f"'saved' is about a run that is not one of the {len(runs)}")
    if len(runs.advice) != len(runs):
        raise ArchiveError(f"'advice' is of {len(runs.advice)} runs, not of {len(runs)}")
    if runs.work is not None and set(runs.work) != set(runs.sources):
        raise ArchiveError("members 'work/…' and 'sources' have different names")
    whole = ~(runs.diverged | runs.stopped)[:, None] & (
        (runs.t < runs.ended[:, None]) | (runs.ended >= runs.t[-1])[:, None]
    )
    for name in ("q", "v", "u", "kinetic", "potential"):
        array = getattr(runs, name)
        if array is not None and not np.isfinite(array[whole]).all():
            raise ArchiveError(f"member {name!r} of a run that did not diverge holds nan or inf")


_ROLLOUTS = Format(ROLLOUTS_FORMAT, Rollouts, _check)
