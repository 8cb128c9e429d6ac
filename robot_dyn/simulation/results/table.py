"""The samples of a run as columns, each with its unit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robot_dyn.queries.units import unit
from robot_dyn.simulation.columns import Column
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.simulation.results.trajectory import Trajectory


def columns(run: Trajectory) -> Iterator[Column]:
    """q, v, a, u and desired positions by joint, or the deviation of a frame; power by source; energy; states."""
    types = dict(zip(run.joint_names, joint_types(run), strict=True))

    def of_joints(quantity: str, values: np.ndarray, like: str) -> Iterator[Column]:
        for (name, kind), x in zip(types.items(), values.T, strict=True):
            yield Column(quantity, x, unit(like, kind), name)

    yield Column("t", run.t, "s")
    for key in ("q", "v", "a", "u"):
        yield from of_joints(key, getattr(run, key), key)
    if run.desired is not None:
        yield from of_joints("desired", run.desired, "q")
    elif run.deviation is not None:  # of a frame; that of the joints is q − desired
        yield from (Column("deviation", x, "m", axis) for axis, x in zip("xyz", run.deviation.T, strict=True))
    yield from (Column("power", power, "W", name) for name, power in run.power.items())
    yield Column("energy", run.ledger.energy, "J")
    yield Column("residual", run.ledger.residual, "J")
    states = () if run.controller_states is None else (("controller", run.controller_states),)
    for name, z in (*states, *run.effect_states.items()):
        yield from (Column(f"{name} state", x, of=str(k + 1)) for k, x in enumerate(z.T))
