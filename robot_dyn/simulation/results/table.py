"""The samples of a run as columns, each with its unit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from robot_dyn.queries.units import unit
from robot_dyn.simulation.columns import Column
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.simulation.results.run_data import SAMPLED, TrajectoryData

Types = Mapping[str, str | None]  # types of joints by name


def columns(run: TrajectoryData) -> Iterator[Column]:
    """Yield the quantities with a heading: those of joints and sources by name, states by number.

    The tracking error of joints is left out: it is desired − q.
    """
    types = dict(zip(run.joint_names, joint_types(run), strict=True))
    for key, row in SAMPLED.items():
        values = getattr(run.ledger if key in ("energy", "residual") else run, key) if row.heading else None
        if values is None or (key == "tracking_error" and run.desired is not None):
            continue
        for name, x in values.items() if isinstance(values, dict) else (("", values),):
            if x.ndim == 1:
                yield Column(row.heading, x, row.unit, name, row.title, row.over)
            elif row.of_joints:
                yield from of_joints(row.heading, x, row.unit, types, row.title)
            else:
                numbers = "xyz" if row.over else map(str, range(1, 1 + x.shape[1]))
                for label, y in zip(numbers, x.T, strict=True):
                    yield Column(f"{name} {row.heading}".lstrip(), y, row.unit, label, row.title, row.over)


def of_joints(heading: str, values: np.ndarray, like: str, types: Types, title: str = "") -> Iterator[Column]:
    """Yield columns of values (k, n), in the unit of the quantity `like`."""
    for (name, kind), x in zip(types.items(), values.T, strict=True):
        yield Column(heading, x, unit(like, kind), name, title)
