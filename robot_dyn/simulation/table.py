"""A run, or the runs of a batch, as a table: CSV, with names and units in the heading."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from robot_dyn.errors import shown
from robot_dyn.files import Kind, save, target
from robot_dyn.queries.units import unit
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.simulation.results.run_file import RunFileError
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.simulation.rollouts.result import Rollouts

TABLE = Kind("a table of a run", ".csv", b"t [s]")
RUNS = Kind("a table of runs", ".csv", b"run,")

Column = tuple[str, np.ndarray]  # heading, and a number for each row


def export_csv(run: Trajectory | Rollouts, path: str | Path) -> Path:
    """Write a row for each sample of a trajectory, or for each run of a batch, to `path`, whole or not at all.

    A row of a run has its parameters, its start, its end, its tracking error in [rad] or [m], what its remarks are
    about, and the extremes of q, v and u. Another table of the same kind under that name is replaced; a file of another
    kind is not. The suffix .csv is added if the path has none.

    Raises:
        RunFileError: If it cannot be written.
    """
    if not isinstance(run, Trajectory | Rollouts):
        raise RunFileError(f"export_csv takes a Trajectory of rd.simulate, or Rollouts, got {shown(run)}")
    of_runs = isinstance(run, Rollouts)
    path = target(path, RUNS if of_runs else TABLE, RunFileError)
    heading, columns = zip(*(_of_runs(run) if of_runs else _of_samples(run)), strict=True)
    table = io.StringIO()
    csv.writer(table).writerows([heading, *zip(*(each.tolist() for each in columns), strict=True)])
    return save(path, lambda stream: stream.write(table.getvalue().encode()), RunFileError)


def _of_samples(run: Trajectory) -> Iterator[Column]:
    types = dict(zip(run.joint_names, joint_types(run), strict=True))
    yield "t [s]", run.t
    for key in ("q", "v", "a", "u"):
        for (name, kind), x in zip(types.items(), getattr(run, key).T, strict=True):
            yield f"{key} {name} [{unit(key, kind)}]", x
    yield from ((f"power {name} [W]", power) for name, power in run.power.items())
    yield "energy [J]", run.ledger.energy
    yield "residual [J]", run.ledger.residual
    states = {} if run.controller_states is None else {"controller": run.controller_states}
    for name, z in (*states.items(), *run.effect_states.items()):
        yield from ((f"{name} state {k + 1}", x) for k, x in enumerate(z.T))


def _of_runs(runs: Rollouts) -> Iterator[Column]:
    yield "run", np.arange(len(runs))
    for name, values in runs.params.items():
        numbered = values.shape[1] > 1
        yield from ((f"{name} {k + 1}" if numbered else name, x) for k, x in enumerate(values.T))
    types = dict(zip(runs.joint_names, joint_types(runs), strict=True))
    for key, start in (("q", runs.q0), ("v", runs.v0)):
        columns = () if start is None else zip(types.items(), start.T, strict=True)
        yield from ((f"start {key} {name} [{unit(key, kind)}]", x) for (name, kind), x in columns)
    yield "ended [s]", runs.ended
    yield "outcome", np.array([runs.outcome(i).ending.value for i in range(len(runs))])
    yield "steps", runs.steps
    if runs.tracking_error is not None:
        yield "tracking error [rad or m]", runs.tracking_error
    about = [(set(each.runs), f"{each.kind} {each.quantity} {each.joint}") for each in runs.remarks]
    yield "remarks", np.array(["; ".join(text for of, text in about if i in of) for i in range(len(runs))])
    if runs.observed is None:
        return
    for row, key in enumerate(("q", "v", "u")):
        for joint, (name, kind) in enumerate(types.items()):
            for side, least in enumerate(("least", "largest")):
                yield f"{least} {key} {name} [{unit(key, kind)}]", runs.observed.extremes[:, row, side, joint]
