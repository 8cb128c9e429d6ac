"""Read run files: of one run or of a batch."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from robot_dyn.foundations.files import file_path, read_start
from robot_dyn.simulation.results.provenance import unpacked
from robot_dyn.simulation.results.run_file import REMEDY, RUN, RunFileError, run_format
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.simulation.rollouts.result import Rollouts
from robot_dyn.simulation.rollouts.run_file import rollouts_format

_TABLE = "a table cannot be read back: save the run as .npz as well"
_OTHER_READERS = {
    ".toml": "rd.read_scene reads a scene",
    ".urdf": "rd.load reads a robot",
    ".xacro": "rd.load reads a robot",
    ".xml": "rd.load reads a robot",
    ".csv": f"{_TABLE}; rd.control.from_samples reads a motion",
    ".mcap": f"{_TABLE}; rd.control.from_samples reads a motion",
    ".parquet": _TABLE,
    ".nc": _TABLE,
}


def read(path: str | Path) -> Trajectory | Rollouts:
    """Return the run, or the batch of runs, of a run file (.npz) that `save` wrote.

    Rollouts of a file have no `setup`.

    Raises:
        RunFileError: If the file is missing, damaged, cut short or of another format.
    """
    path = file_path(path, RunFileError)
    if os.path.isdir(path):
        raise RunFileError(f"{path}: is a folder; rd.tools.sweeps.read_sweep reads the folder of a sweep")
    reader = _OTHER_READERS.get(path.suffix.lower())
    if reader and read_start(path, len(RUN.start), RunFileError, REMEDY) != RUN.start:
        raise RunFileError(f"{path}: is not a run file (.npz); {reader}")
    run = run_format(Trajectory).load(path, rollouts_format(Rollouts))
    assert isinstance(run, Trajectory | Rollouts)
    return replace(run, metadata=unpacked(run.metadata, path))
