"""Simulate: a setup → a Trajectory with its energy ledger and an estimate of its error.

The plant moves in continuous time. A controller with a period acts at its ticks and is held between them; steps end at
ticks, at the switches of effects, and at the end. A run keeps all its samples, however it ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from robot_dyn.control.cartesian import CartesianReference
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.effects.plant import Plant
from robot_dyn.errors import RobotDynError
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.model.dynamics import Dynamics
from robot_dyn.simulation.error import ErrorEstimate, difference, richardson
from robot_dyn.simulation.ledger import Ledger
from robot_dyn.simulation.loads import at_stop, wrenches
from robot_dyn.simulation.march import Counter, DivergedError, Sample, march
from robot_dyn.simulation.motion import Motion
from robot_dyn.simulation.origin import origin
from robot_dyn.simulation.setup import Setup
from robot_dyn.simulation.trajectory import Ending, Outcome, Statistics, Trajectory

_SHARED = 2000  # at most about this many times at which companion runs are compared


def simulate(
    what: Setup | Plant | Dynamics, *, on_progress: Callable[[float], object] | None = None, **options: Any
) -> Trajectory:
    """Run a setup; or a plant or robot, with the attributes of a `Setup` as options: q0, duration_s, controller, ….

    Args:
        what: What to run.
        on_progress: Called with the time reached, in [s], at each step.
        **options: Attributes of the setup, or those to change.

    Raises:
        QueryError: If the setup has no meaning. Whatever happens later is told by the trajectory's outcome.
    """
    if isinstance(what, Setup):
        setup = replace(what, **options)
    else:
        setup = Setup(what if isinstance(what, Plant) else Plant(what), **options)
    motion = Motion(setup.plant, setup.controller, getattr(setup.integrator, "canonical", False))
    counter, kept, shared = Counter(), [], []
    began = perf_counter()
    outcome = _collect(setup, motion, 1, counter, kept, shared, on_progress)
    wall = perf_counter() - began
    error = None
    if setup.estimate_error and outcome.ending is not Ending.STOPPED:
        error = _estimate(setup, motion, shared)
    companions = perf_counter() - began - wall if setup.estimate_error else 0.0
    adaptive = isinstance(setup.integrator, Adaptive)
    name = setup.integrator.method if isinstance(setup.integrator, Adaptive) else setup.integrator.name
    step = 0.0 if adaptive else outcome.t / max(counter.steps, 1)
    statistics = Statistics(name, step, counter.steps, counter.evaluations, wall, companions)
    return _trajectory(setup, motion, kept, outcome, statistics, error)


def _collect(
    setup: Setup,
    motion: Motion,
    factor: int,
    counter: Counter,
    kept: list[Sample],
    shared: list[tuple[float, np.ndarray]],
    on_progress: Callable[[float], object] | None = None,
) -> Outcome:
    """March; keep samples at the record period, and positions at the times that companions share."""
    n, next_record, t = motion.plant.dynamics.n, 0.0, 0.0
    thin = max(1, sum(map(setup.steps, setup.stretches)) // (4 * _SHARED))
    seen = 0
    try:
        with np.errstate(all="ignore"):  # what overflows ends the march
            for sample in march(setup, motion, factor, counter):
                t, last = sample.t, sample.t == setup.duration_s
                if t >= next_record - 1e-9 * setup.step_s or last:
                    kept.append(sample)
                    next_record += setup.record_period_s
                if sample.shared:
                    if seen % thin == 0 or last:
                        shared.append((t, sample.y[:n]))
                    seen += 1
                if on_progress is not None:
                    on_progress(t)
    except DivergedError as end:
        return Outcome(Ending.DIVERGED, end.t, str(end))
    except KeyboardInterrupt:
        return Outcome(Ending.STOPPED, t, "interrupted; all samples up to here are kept")
    return Outcome(Ending.FINISHED, t)


def _estimate(setup: Setup, motion: Motion, run: list[tuple[float, np.ndarray]]) -> ErrorEstimate:
    """Companion runs: of 2 and 4 times the step, or of 10 times the tolerance."""
    adaptive = isinstance(setup.integrator, Adaptive)
    if not adaptive and min(map(setup.steps, setup.stretches)) < 4:
        return ErrorEstimate(np.empty(0), np.empty(0), 0.0, "fewer than 4 steps between ticks, switches or breaks")
    runs = [run]
    for factor in (10,) if adaptive else (2, 4):
        runs.append([])
        _collect(setup, motion, factor, Counter(), [], runs[-1])
    reached = min(map(len, runs))
    t = np.array([t for t, _ in run[:reached]])
    positions = [np.array([q for _, q in each[:reached]]) for each in runs]
    if isinstance(setup.integrator, Adaptive):
        return difference(t, *positions)
    return richardson(t, *positions, order=setup.integrator.order)


def _trajectory(
    setup: Setup,
    motion: Motion,
    kept: list[Sample],
    outcome: Outcome,
    statistics: Statistics,
    error: ErrorEstimate | None,
) -> Trajectory:
    """The samples with what follows from them."""
    rows = [_row(setup, motion, sample) for sample in kept]
    q, v, a, tau, W, P, E = (np.array(column) for column in zip(*rows, strict=True))
    t = np.array([sample.t for sample in kept])
    wanted, deviation = _deviation(setup, t, q)
    ledger = Ledger(E[:, 0], E[:, 1], dict(zip(motion.sources, W.T, strict=True)))
    power = dict(zip(motion.sources, P.T, strict=True))
    plant = setup.plant
    names, about = plant.dynamics.joint_names, origin(plant.dynamics) | setup.about
    if isinstance(frame := getattr(setup.controller, "frame", None), str):
        about = {"frame": frame} | about
    return Trajectory(
        names, t, q, v, a, tau, power, ledger, wanted, deviation, outcome, statistics, error, about,
        wrenches(plant, t, q), at_stop(plant, q),
    )  # fmt: skip


def _row(setup: Setup, motion: Motion, sample: Sample) -> tuple[Any, ...]:
    """q, v, a, u, work, power and energies of a sample; nan for what has no value just before a run diverged."""
    q, v, z, W = motion.state(sample.y)
    u = a = np.full_like(q, np.nan)
    power, energy = np.full_like(W, np.nan), np.full(2, np.nan)
    try:
        with np.errstate(all="ignore"):
            energy = np.array(motion.energy(sample.t, q, v))
            u = motion.command(sample.t, q, v, z) if sample.held is None else sample.held
            power = motion.powers(sample.t, q, v, u)
            a = setup.plant.forward_dynamics(sample.t, q, v, u)
    except RobotDynError:
        pass
    return q, v, a, u, W, power, energy


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
