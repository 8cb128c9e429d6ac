"""Runs of one setup from many starts, or with many values of its parameters, side by side in machine code.

    q' = v,   v' = M⁻¹ (τ − C v − N)   for 64 runs side by side, on all threads

Each run is a lane of a tile, and no lane depends on another: a run that diverges does not change the others.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.codegen.parameters import CONTROLLER, Parameter, names_of, parameters, variable_parameters
from robot_dyn.codegen.threads import thread_count
from robot_dyn.description.edits import Edits
from robot_dyn.effects.effect import Effect
from robot_dyn.effects.plant import Plant
from robot_dyn.effects.rigid_stops import RigidStops
from robot_dyn.foundations.coefficients import rebuilt
from robot_dyn.foundations.errors import QueryError, nearest, shown
from robot_dyn.foundations.validate import JointValues, choice, integer, joint_values, numbers, truth
from robot_dyn.foundations.values import several
from robot_dyn.integrate.adaptive import AUTO, EXPLICIT, Adaptive
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import joint_units
from robot_dyn.simulation.results.provenance import joint_types, origin
from robot_dyn.simulation.results.run_data import SAMPLED
from robot_dyn.simulation.rollouts.batch import Batch
from robot_dyn.simulation.rollouts.comparison import Comparison, differences, drawn
from robot_dyn.simulation.rollouts.lock_step import Tiles, lanes_code
from robot_dyn.simulation.rollouts.one_by_one import one_by_one
from robot_dyn.simulation.rollouts.result import Rollouts
from robot_dyn.simulation.rollouts.thresholds import Thresholds
from robot_dyn.simulation.setup.checks import check_stops
from robot_dyn.simulation.setup.options import Options, setup_of, takes_options
from robot_dyn.simulation.setup.setup import MOST_BYTES, Setup, check_batch

LARGEST_NUMBER = 2**53  # largest number of a run
RECORDS = ("q", "v", "u", "energy", "work")


@takes_options
def rollouts(
    system: Setup | Plant | Dynamics,
    q0: JointValues | None = None,
    v0: JointValues | None = None,
    *,
    vary: Mapping[str, ArrayLike] | None = None,
    record: Iterable[str] = ("q", "v"),
    uncut: bool = False,
    numbers: ArrayLike | None = None,
    threads: int | None = None,
    max_bytes: int = MOST_BYTES,
    on_progress: Callable[[float], object] | None = None,
    **options: Unpack[Options],
) -> Rollouts:
    """Run a plant, a robot or a setup many times: from many starts, or with many values of its parameters.

    Each run equals that of `simulate`, to rounding. With an explicit, Gauss or Rosenbrock method of fixed step, for
    example `method="RK4"`, and with time stepping, the runs are in lock step in machine code. Runs that may pass a
    threshold (a stop, an effort limit, a reversal of friction with states) are repeated one after the other on each
    thread, with steps that end there, which takes a few milliseconds a run.

    Otherwise each thread executes its runs one after the other. This holds for methods that choose their steps, such
    as the default. With a fixed step it holds if dry friction, rigid stops, switched payloads or events end steps, or
    if steps may be cut and samples lie within them.

    Args:
        system: A plant, a robot or a setup.
        q0: Positions at the start, (B, n) or (n,), in [rad] or [m] by joint; required unless `system` is a setup.
        v0: Velocities at the start, (B, n) or (n,), in [rad/s] or [m/s]; by default 0, or those of the setup.
        vary: Values that differ from run to run, by name, (B,) or (B, n) each; `rd.parameters` lists the names:
            gains of the controller, "kp"; coefficients of an effect, "viscous_friction.viscous", or of one of several
            of a kind, "external_wrench 2.wrench"; "gravity", (B, 3); mass in [kg] and centre of mass of a payload on a
            link, "payload_mass:tool0" and "payload_com:tool0", (B, 3); "armature", (B, n); "mass_scale", (B,); mass and
            inertia of a link, see `Robot.with_`, "link3.mass" and "link3.inertia", (B, 3, 3), or a factor on both,
            "link3.mass_scale". Models of controllers
            have separate values: "model.gravity", ….
        record: Quantities to record at the samples: some of "q", "v", "u", "energy", "work". Only `simulate` records
            states of effects and controllers.
        uncut: True to take whole steps across thresholds, in lock step: nearly as fast as without thresholds, but with
            the error of a step across one. At most 64 runs, drawn at random, are repeated with steps that end at
            thresholds: see `Rollouts.comparison`.
        numbers: Number of each run, which determines its noise, (B,); by default 0 to B − 1. The bits of a run depend
            on its number, start and parameters, not on the other runs.
        threads: Number of threads; None for all processors.
        max_bytes: Largest size of the record, in bytes.
        on_progress: Called with the mean time that the runs have reached, in [s], some ten times a second; with a
            record period of 0 it grows as tiles of 64 runs end.
        **options: Options of `simulate`, except `estimate_error` and `accuracy`, which have no effect here: no error is
            estimated (`simulate` one of the runs for that). The method "auto" means DOP853 here, and the engine "auto"
            means machine code; "interpreted" executes the runs one after the other in Python.

    Runs are observed at every step. `Rollouts.remarks` counts the runs whose actuation reverses at every tick, that
    reach or pass a limit or a stop, whose reference starts at another state than the joint, or whose reference moves a
    joint that friction holds. In lock step the actuation of a continuous controller is observed at samples and at 200
    or more instants, or at every step if there are fewer; its reversals are not detected. The other remarks of
    `simulate` are made for single runs only.

    Returns:
        The runs, in the order given. After Ctrl-C they contain the samples recorded up to then.

    Raises:
        QueryError: If an argument is not allowed or has the wrong shape, or the record would exceed `max_bytes`.
        TraceError: If a part of the setup cannot be compiled; the message names it.
    """
    setup = replace(_setup(system, q0, options), estimate_error=False)
    if isinstance(setup.method, Adaptive) and setup.method.name == AUTO:
        setup = replace(setup, method=replace(setup.method, method=EXPLICIT))
    max_bytes = integer("max_bytes", max_bytes, most=2**63 - 1)
    if not setup.method.plain:
        raise QueryError(
            f"rollouts do not support {setup.method.name}, only explicit, Gauss and Rosenbrock methods and those that"
            f" choose their steps: give method='RK4' and its step_s; simulate takes any method"
        )
    if vary is not None and not (isinstance(vary, Mapping) and all(isinstance(name, str) for name in vary)):
        raise QueryError(f"vary must give values by name, such as {{'kp': …}}, got {shown(vary)}")
    batch = batch_of(setup, q0, v0, vary or {}, record, numbers)
    uncut, count = truth("uncut", uncut), thread_count(threads)
    runs = run_batch(batch, batch.thresholds, uncut, count, max_bytes, on_progress)
    return replace(runs, comparison=_compared(batch, runs, count, max_bytes)) if runs.uncut else runs


def batch_of(
    setup: Setup,
    q0: JointValues | None,
    v0: JointValues | None,
    vary: Mapping[str, ArrayLike],
    record: Iterable[str],
    numbers: ArrayLike | None = None,
) -> Batch:
    """Return the runs of a setup; arguments and errors as in `rollouts`."""
    if (recorded := several(record)) is None:
        raise QueryError(f"record: give names of {', '.join(RECORDS)}, got {shown(record)}")
    recorded = tuple(choice("record", name, RECORDS) for name in recorded)
    names = setup.plant.dynamics.joint_names
    q = joint_values("q0", setup.q0 if q0 is None else q0, names)
    v = joint_values("v0", setup.v0 if v0 is None else v0, names)
    sweep = {name: _values(setup, name, x) for name, x in vary.items()}
    counts, n = {len(x) for x in (q, v, *sweep.values()) if x.ndim > 1} or {1}, len(names)
    if len(counts) > 1 or max(q.ndim, v.ndim) > 2 or counts == {0}:
        shapes = {"q0": q.shape, "v0": v.shape} | {name: np.shape(x) for name, x in vary.items()}
        rows = f"q0 and v0 ({n},) or (B, {n}), values of vary (B,) or (B, …)"
        raise QueryError(f"q0, v0 and vary must have the same number of runs, B ≥ 1: {rows}; got {shapes}")
    B = counts.pop()
    q, v = (np.broadcast_to(x, (B, n)) for x in (q, v))
    batch = Batch(setup, q, v, sweep, recorded, None if numbers is None else _numbers(numbers, B))
    if any(isinstance(effect, RigidStops) for effect in setup.plant.effects):
        for run in range(B):
            check_stops(batch.parts(run)[0], q[run], f"q0 of run {run}")
    return batch


def _numbers(values: ArrayLike, count: int) -> np.ndarray:
    """Return numbers of runs, (B,)."""
    array = numbers("numbers", values, ("B",), least=0)
    if array.shape != (count,) or (array != np.floor(array)).any() or array.max() > LARGEST_NUMBER:
        raise QueryError(f"numbers: give a whole number for each of the {count} runs, 0 to {LARGEST_NUMBER:g}")
    return array.astype(np.int64)


def stepping_groups(batch: Batch) -> list[tuple[np.ndarray, Thresholds | None]]:
    """Return the runs of a batch in groups by stepping strategy, with their thresholds.

    A batch in which some runs have thresholds detects their passage. Its other runs form a separate group, whose bits
    are the same as in a batch without thresholds.
    """
    runs, passed = np.arange(len(batch)), batch.thresholds
    if passed is None or passed.some.all():
        return [(runs, passed)]
    with_thresholds = runs[passed.some]
    return [(with_thresholds, passed.for_runs(with_thresholds)), (runs[~passed.some], None)]


def run_batch(
    batch: Batch, passed: Thresholds | None, uncut: bool, threads: int, max_bytes: int,
    on_progress: Callable[[float], object] | None = None,
) -> Rollouts:  # fmt: skip
    """Return the rollouts of a batch with thresholds `passed`."""
    setup, why = batch.setup, batch.why_one_by_one
    if uncut and why:
        raise QueryError(f"uncut: {why}, so the runs are not in lock step; leave it out")
    check_batch(setup, len(batch), sum(batch.sizes.values()), max_bytes)
    cut = (
        passed is not None or setup.finds_events
    )  # samples are then interpolated within steps, which lock step does not support
    if why or (not uncut and cut and not setup.samples_on_steps):
        record = one_by_one(batch, threads, on_progress)
    else:
        passed_there = None if uncut else passed
        code = lanes_code(batch, detects=passed_there is not None)
        record = Tiles(batch, code, passed_there).run(threads, on_progress)
    columns, sources = record.columns, tuple(setup.equation.sources)
    energy, work = columns.get("energy"), columns.get("work")
    return Rollouts(
        joint_names=setup.plant.dynamics.joint_names, t=record.t, q=columns.get("q"), v=columns.get("v"),
        u=columns.get("u"), kinetic=None if energy is None else energy[..., 0],
        potential=None if energy is None else energy[..., 1],
        work=None if work is None else dict(zip(sources, np.moveaxis(work, -1, 0), strict=True)),
        ends=tuple(record.outcomes),
        steps=record.steps, evaluations=record.evaluations, statistics=record.statistics, sources=sources,
        metadata=origin(setup, compiled=True) | setup.metadata, varied=dict(batch.sweep), setup=record.setup,
        q0=batch.q0, v0=batch.v0,
        observed=record.observed, numbers=batch.numbers, uncut=passed.names if uncut and passed is not None else (),
    )  # fmt: skip


def _compared(batch: Batch, runs: Rollouts, threads: int, max_bytes: int) -> Comparison | None:
    """Compare uncut runs with cut runs from the same starts; None after Ctrl-C."""
    places = drawn(len(batch))
    if runs.stopped.any():
        return None
    some = batch.some(places)
    cut = run_batch(some, some.thresholds, False, threads, max_bytes)
    if cut.stopped.any():
        return None
    kinds = joint_types(runs)
    recorded = {name: getattr(runs, name) for name in ("q", "v", "u", "kinetic", "potential")}
    units = {name: joint_units(name, kinds) if name in "qvu" else SAMPLED[name].unit for name in recorded}
    quantities = {name: x[places] for name, x in recorded.items() if x is not None}
    others = int((runs.diverged[places] != cut.diverged).sum())
    repeated = {name: getattr(cut, name) for name in quantities}
    return Comparison(len(places), len(batch), others, tuple(differences(quantities, repeated, units)))


def _setup(system: Setup | Plant | Dynamics, q0: JointValues | None, options: Mapping[str, Any]) -> Setup:
    """Return the setup of all runs; for a plant or robot, with the first start."""
    start = {}
    if not isinstance(system, Setup):
        system = system if isinstance(system, Plant) else Plant(system)
        if q0 is not None:
            q = joint_values("q0", q0, system.dynamics.joint_names)
            start = {"q0": q.reshape(-1, q.shape[-1])[0] if q.size else np.zeros(q.shape[-1])}
    for name in ("estimate_error", "accuracy"):
        if name in options or (name == "accuracy" and isinstance(system, Setup) and system.accuracy is not None):
            without = "give the setup without it, as dataclasses.replace(setup, accuracy=None)"
            remedy = "leave it out" if name in options else without
            raise QueryError(f"rollouts: {name} has no effect, simulate one of the runs for that; {remedy}")
    return setup_of("rollouts", system, {**start, **options})


def _values(setup: Setup, name: str, values: Any) -> np.ndarray:
    """Return the values of a parameter, (B, size)."""
    plant, controller = setup.plant, setup.controller
    declared = parameters(plant.dynamics, plant.effects, controller, (name, "armature", "mass_scale"))
    matches = [parameter for parameter in declared if parameter.declared.can_vary and parameter.name == name]
    if not matches:
        raise QueryError(f"vary: {_unknown(setup, name)}")
    size, shape, limits = matches[0].size, matches[0].value.shape, matches[0].declared
    shapes = (("B",), ("B", 1), ("B", size)) if limits.is_per_joint or size == 1 else (("B", *shape),)
    array = numbers(
        f"vary: {name}", values, *shapes,
        least=limits.minimum, above=limits.exclusive_minimum, infinite=limits.infinite,
    )  # fmt: skip
    rows = np.ascontiguousarray(np.broadcast_to(array.reshape(len(array), -1), (len(array), size)))
    for parameter in matches:
        for row in np.unique(rows, axis=0):
            _check(setup, parameter, row.reshape(shape))
    return rows


def _check(setup: Setup, parameter: Parameter, value: np.ndarray) -> None:
    """Build the part that has a parameter with the value, which raises an error if the value is invalid."""
    place, key = parameter.part, parameter.key
    if key.startswith("inertia "):
        Edits().with_((), inertias={key.partition(" ")[2]: value})
    elif place == CONTROLLER and "." in key:
        assert setup.controller is not None
        rebuilt(setup.controller, {key: value})
    elif place[0] == "effect":
        effect: Any = setup.plant.effects[int(place[1])]
        if type(effect).__post_init__ is not Effect.__post_init__:  # it checks more than single coefficients
            replace(effect, **{key: value})


def _unknown(setup: Setup, name: str) -> str:
    """Return why a name is not a parameter, and the remedy."""
    effects, (part, _, key) = setup.plant.effects, name.rpartition(".")
    names = [parameter.name for parameter in variable_parameters(setup.plant.dynamics, effects, setup.controller)]
    if alike := [other for other in names_of(effects) if re.fullmatch(rf"{re.escape(part)} \d+", other)]:
        both = " and ".join(repr(f"{other}.{key}") for other in dict.fromkeys(alike))
        return f"{name} names a coefficient of several effects of the plant; give {both}"
    if name.startswith("payload_") and not any(other.startswith("payload_") for other in names):
        payload = f"rd.Payload({name.partition(':')[2] or 'link'!r}, 1.0)"
        return f"no parameter {name!r}: the arm has no payload; add one with robot.with_(payload={payload})"
    if name.partition(".")[0] in ("q0", "v0"):
        return f"no parameter {name!r}: initial states vary as arrays; pass q0= and v0=, or vary q0 and v0 of a sweep"
    return f"no parameter {name!r}; {nearest(name, dict.fromkeys(names))}"
