"""The samples of a run as a table: CSV, a row each, with names and units in the heading."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from robot_dyn.files import Kind, save, target
from robot_dyn.model.units import unit
from robot_dyn.simulation.origin import joint_types
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
    types = dict(zip(trajectory.joint_names, joint_types(trajectory), strict=True))
    heading = ["t [s]"]
    for key in ("q", "v", "a", "u"):
        heading += [f"{key} {name} [{unit(key, kind)}]" for name, kind in types.items()]
    heading += [f"power {name} [W]" for name in trajectory.power] + ["energy [J]", "residual [J]"]
    states = trajectory.controller_states
    heading += [] if states is None else [f"controller state {k + 1}" for k in range(states.shape[1])]
    heading += [f"{name} state {k + 1}" for name, z in trajectory.effect_states.items() for k in range(z.shape[1])]
    columns = [trajectory.t[:, None], trajectory.q, trajectory.v, trajectory.a, trajectory.u]
    columns += [power[:, None] for power in trajectory.power.values()]
    columns += [trajectory.ledger.energy[:, None], trajectory.ledger.residual[:, None]]
    columns += [] if states is None else [states]
    columns += trajectory.effect_states.values()

    table = io.StringIO()
    csv.writer(table).writerows([heading, *np.hstack(columns).tolist()])
    return save(path, lambda stream: stream.write(table.getvalue().encode()), RunFileError)
