"""The samples of a run as a table: CSV, a row each, with names and units in the heading."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from robot_dyn.files import Kind, save, target
from robot_dyn.simulation.run_file import RunFileError
from robot_dyn.simulation.trajectory import Trajectory

TABLE = Kind("a table of a run", ".csv", b"t [s]")


def export_csv(trajectory: Trajectory, path: str | Path) -> Path:
    """Write the samples to `path` (.csv is added if it has no suffix), whole or not at all.

    Another table of a run under that name is replaced; a file of another kind is not.

    Raises:
        RunFileError: If it cannot be written.
    """
    path = target(path, TABLE, RunFileError)
    names = trajectory.joint_names
    heading = ["t [s]"]
    for key, unit in (("q", "rad or m"), ("v", "rad/s or m/s"), ("a", "rad/s² or m/s²"), ("tau", "N m or N")):
        heading += [f"{key} {name} [{unit}]" for name in names]
    heading += [f"power {name} [W]" for name in trajectory.power] + ["energy [J]", "residual [J]"]
    columns = [trajectory.t[:, None], trajectory.q, trajectory.v, trajectory.a, trajectory.tau]
    columns += [power[:, None] for power in trajectory.power.values()]
    columns += [trajectory.ledger.energy[:, None], trajectory.ledger.residual[:, None]]

    table = io.StringIO()
    csv.writer(table).writerows([heading, *np.hstack(columns).tolist()])
    return save(path, lambda stream: stream.write(table.getvalue().encode()), RunFileError)
