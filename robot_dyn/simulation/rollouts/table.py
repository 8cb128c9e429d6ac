"""The runs of a batch as columns, a row for each run: varied parameters, outcome, rms and extremes by joint."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robot_dyn.codegen.parameters import parameters
from robot_dyn.queries.units import joint_units, of_joint
from robot_dyn.simulation.columns import Column, Variable
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.simulation.results.run_data import SAMPLED
from robot_dyn.simulation.results.samples import root_mean_squares
from robot_dyn.simulation.results.table import Types, of_joints
from robot_dyn.simulation.rollouts.overview import texts_by_run
from robot_dyn.simulation.rollouts.parameters import setup_parameter
from robot_dyn.simulation.rollouts.rollouts_data import Overview, RolloutsData


def columns(runs: RolloutsData, overview: Overview) -> Iterator[Column]:
    """Yield columns with a value for each run; the rms is over the samples up to its end, extremes over its steps."""
    types = dict(zip(runs.joint_names, joint_types(runs), strict=True))
    yield Column("run", np.arange(len(runs)))
    yield from _of_parameters(runs, types)
    for key, start in (("q", runs.q0), ("v", runs.v0)):
        yield from of_joints(f"start {key}", start, key, types)
    yield Column("ended", runs.ended_s, "s")
    yield Column("outcome", np.array([end.ending.value for end in runs.ends]))
    yield Column("reason", np.array([outcome.reason.value for outcome in runs.outcomes]))
    yield Column("steps", runs.steps)
    if overview.rms_tracking_error is not None:
        yield Column(
            "rms tracking error",
            overview.rms_tracking_error,
            "m" if "frame" in runs.metadata else joint_units("q", types.values()),
        )
    texts = texts_by_run(overview.remarks, len(runs))
    yield Column("number of remarks", np.array([text.count(";") + 1 if text else 0 for text in texts]))
    yield Column("remarks", np.array(texts))
    for key in ("v", "u"):
        if (x := getattr(runs, key)) is not None:
            yield from of_joints(f"rms {key}", root_mean_squares(x), key, types)
    for row, key in enumerate(("q", "v", "u")):
        for side, which in enumerate(("least", "largest")):
            yield from of_joints(f"{which} {key}", runs.observed.extremes[:, row, side], key, types)


def samples(runs: RolloutsData) -> dict[str, Variable]:
    """Return the recorded quantities over runs and sample times."""
    kinds, variables = joint_types(runs), dict[str, Variable]()
    for key, row in SAMPLED.items():
        values = getattr(runs, key, None)
        for name, x in values.items() if isinstance(values, dict) else (("", values),):
            if x is not None:
                over = ("t",) if key == "t" else ("run", "t", "joint")[: x.ndim]
                about = {"units": joint_units(row.unit, kinds) if row.of_joints else row.unit, "long_name": row.title}
                about |= {"long_name": f"{row.title} of {name}"} if name else {}
                variables[f"{key}_{name}" if name else key] = over, x, about
    return variables


def _of_parameters(runs: RolloutsData, types: Types) -> Iterator[Column]:
    """Yield the varied parameters: by joint if the setup declares them so, otherwise numbered if there are several."""
    setup = runs.setup
    varied = (
        () if setup is None else parameters(setup.plant.dynamics, setup.plant.effects, setup.controller, runs.varied)
    )
    declared = {parameter.name: parameter.declared for parameter in varied if parameter.declared.is_per_joint}
    about = {} if setup is None else {x.name: setup_parameter(x, setup.plant.dynamics).unit for x in varied}
    for name, values in runs.varied.items():
        columns = values.T
        if name in declared and len(columns) == len(types):
            for (joint, kind), x in zip(types.items(), columns, strict=True):
                yield Column(name, x, of_joint(declared[name].unit, kind), joint)
        else:
            several = len(columns) > 1
            yield from (Column(name, x, about.get(name, ""), str(k + 1) * several) for k, x in enumerate(columns))
