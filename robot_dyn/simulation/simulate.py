"""Simulate: a setup → a Trajectory with its energy ledger and an estimate of its error.

The plant moves in continuous time. A controller with a period acts at its ticks and is held between them; steps end at
ticks, at the switches of effects, and at the end. A run keeps all its samples, however it ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.control.cartesian import CartesianReference
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.effects.plant import Plant
from robot_dyn.errors import QueryError, nearest
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.model.dynamics import Dynamics
from robot_dyn.simulation.choice import choose
from robot_dyn.simulation.error import ErrorEstimate, difference, richardson
from robot_dyn.simulation.ledger import Ledger
from robot_dyn.simulation.loads import at_stop, link_of, wrenches
from robot_dyn.simulation.motion import Motion
from robot_dyn.simulation.observed import observer_of, remarks
from robot_dyn.simulation.observer import Observer
from robot_dyn.simulation.origin import origin
from robot_dyn.simulation.record import Record, collect
from robot_dyn.simulation.samples import columns, compiled_rows
from robot_dyn.simulation.setup import Setup
from robot_dyn.simulation.size import check_record
from robot_dyn.simulation.trajectory import Ending, Outcome, Statistics, Trajectory

if TYPE_CHECKING:
    from robot_dyn.simulation.machine.machine import Machine

_SHARED = 2000  # at most about this many times at which companion runs are compared


def simulate(
    what: Setup | Plant | Dynamics, *, on_progress: Callable[[float], object] | None = None, **options: Any
) -> Trajectory:
    """Run a setup; or a plant or robot, with the attributes of a `Setup` as options: q0, duration_s, controller, ….

    Args:
        what: What to run.
        on_progress: Called with the time reached, in [s], at each step; in machine code some ten times a second.
        **options: Attributes of the setup, or those to change.

    Raises:
        QueryError: If the setup has no meaning, or its record would not fit into memory. Whatever happens later is
            told by the trajectory's outcome.
    """
    for name in options.keys() - Setup.__dataclass_fields__.keys():
        raise QueryError(f"simulate: no option {name!r}; {nearest(name, Setup.__dataclass_fields__)}")
    if isinstance(options.get("integrator"), Adaptive):
        options = {"step_s": Setup.step_s} | options  # a step that was given for another method means nothing to it
    if isinstance(what, Setup):
        setup = replace(what, **options)
    else:
        setup = Setup(what if isinstance(what, Plant) else Plant(what), **options)
    motion = Motion(setup.plant, setup.controller, getattr(setup.integrator, "canonical", False))
    check_record(setup, motion)
    machine, engine = choose(setup, motion)
    began = perf_counter()
    observer = observer_of(setup, motion)
    record = _run(setup, motion, machine, 1, on_progress, observer)
    wall = perf_counter() - began
    error = None
    if setup.estimate_error and record.outcome.ending is not Ending.STOPPED:
        try:
            error = _estimate(setup, motion, machine, record)
        except KeyboardInterrupt:
            error = ErrorEstimate(np.empty(0), np.empty(0), 0.0, "its companion runs were interrupted")
            if record.outcome.ending is Ending.FINISHED:
                outcome = Outcome(Ending.STOPPED, record.outcome.t, "interrupted after the run, in its error estimate")
                record = replace(record, outcome=outcome)
    companions = perf_counter() - began - wall if setup.estimate_error else 0.0
    adaptive = isinstance(setup.integrator, Adaptive)
    name = setup.integrator.method if isinstance(setup.integrator, Adaptive) else setup.integrator.name
    step = 0.0 if adaptive else record.outcome.t / max(record.steps, 1)
    statistics = Statistics(name, step, record.steps, record.evaluations, wall, companions, engine)
    observer.close()
    return _trajectory(setup, motion, machine, record, statistics, error, observer)


def _run(
    setup: Setup,
    motion: Motion,
    machine: Machine | None,
    factor: int,
    on_progress: Callable[[float], object] | None = None,
    observer: Observer | None = None,
) -> Record:
    """March in machine code, in the interpreted engine, or in that with its rate in machine code."""
    thin = max(1, sum(map(setup.steps, setup.stretches)) // (4 * _SHARED))
    if machine is not None and machine.whole:
        from robot_dyn.simulation.machine.follow import follow

        record = follow(setup, motion, machine, factor, thin, on_progress, observer)
    else:
        systems = partial(machine.system, setup=setup) if machine is not None else None
        record = collect(setup, motion, factor, thin, systems, on_progress, observer)
    if factor != 1 and record.outcome.ending is Ending.STOPPED:
        raise KeyboardInterrupt
    return record


def _estimate(setup: Setup, motion: Motion, machine: Machine | None, run: Record) -> ErrorEstimate:
    """Companion runs: of 2 and 4 times the step, or of 10 times the tolerance."""
    adaptive = isinstance(setup.integrator, Adaptive)
    if not adaptive and min(map(setup.steps, setup.stretches)) < 4:
        return ErrorEstimate(np.empty(0), np.empty(0), 0.0, "fewer than 4 steps between ticks, switches or breaks")
    runs = [run, *(_run(setup, motion, machine, factor) for factor in ((10,) if adaptive else (2, 4)))]
    reached = min(len(each.shared_t) for each in runs)
    t, positions = run.shared_t[:reached], [each.shared_q[:reached] for each in runs]
    if isinstance(setup.integrator, Adaptive):
        return difference(t, *positions)
    return richardson(t, *positions, order=setup.integrator.order)


def _trajectory(
    setup: Setup,
    motion: Motion,
    machine: Machine | None,
    record: Record,
    statistics: Statistics,
    error: ErrorEstimate | None,
    observer: Observer,
) -> Trajectory:
    """The samples with what follows from them."""
    t = record.t
    if record.rows is not None:
        q, v, a, tau, W, P, E = columns(motion, record.rows)
    else:
        assert machine is not None
        q, v, a, tau, W, P, E = compiled_rows(motion, machine, record)
    wanted, deviation = _deviation(setup, t, q)
    ledger = Ledger(E[:, 0], E[:, 1], dict(zip(motion.sources, W.T, strict=True)))
    power = dict(zip(motion.sources, P.T, strict=True))
    plant = setup.plant
    names, about = plant.dynamics.joint_names, origin(plant.dynamics) | setup.about
    if isinstance(frame := getattr(setup.controller, "frame", None), str):
        about = {"frame": link_of(plant.dynamics, frame)} | about
    return Trajectory(
        names, t, q, v, a, tau, power, ledger, wanted, deviation, record.outcome, statistics, error, about,
        wrenches(plant, t, q), at_stop(plant, q),
        remarks(setup, observer, t, np.hstack([q, v, tau])), observer.extremes,
    )  # fmt: skip


def _deviation(setup: Setup, t: np.ndarray, q: np.ndarray) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Wanted positions, and how far the joints, or the frame, are from what the reference wants."""
    controller: Any = setup.controller
    reference = getattr(controller, "reference", None)
    if isinstance(reference, PiecewisePolynomial):
        wanted = reference.at(t)[0]
        return wanted, q - wanted
    if isinstance(reference, CartesianReference):
        return None, setup.plant.dynamics.placement(q, controller.frame)[:, :3, 3] - reference.at(t)[0]
    return None, None
