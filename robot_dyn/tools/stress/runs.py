"""Random runs whose error estimates are compared with two better runs: a small estimate without a warning misleads.

Scenes are a free swing, friction, stops and control, with a random method. The better runs have the same equations as
the run, but other methods and steps: DOP853 and an implicit method near rounding. Only `compare` and the energy reveal
errors of the equations themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from robot_dyn import Plant, Robot, RobotDynError, Setup, simulate
from robot_dyn.accuracy import Batch, evaluate
from robot_dyn.control import PD, gains_from, quintic
from robot_dyn.effects import DryFriction, Effect, RegularisedCoulombFriction, RigidStops, ViscousFriction, joint_stops
from robot_dyn.integrate import Adaptive, method
from robot_dyn.queries import M
from robot_dyn.report import Budget
from robot_dyn.simulation import Ending
from robot_dyn.tools.stress.limits import LEAST, says
from robot_dyn.tools.stress.result import JudgedRun
from robot_dyn.tools.stress.work import Work
from robot_dyn.tools.stress.worst import shrunk

FAMILIES = ("swing", "friction", "dry friction", "stops", "rigid stops", "PD", "sampled PD")
_METHODS = ("Euler", "SemiImplicitEuler", "Midpoint", "RK4", "DP8", "GaussLegendre4", "Rodas5PFixed")
_DRAWS = 20  # attempts to draw a method that the scene accepts
_RECORDS = 20
_BETTER = (Adaptive("DOP853", 3e-14, 1e-15), Adaptive("Rodas5P", 1e-11, 1e-13))
_ROUNDING = 1e-12  # relative to 1 + |q|: smaller errors cannot be measured
_ONE_TIME = 1e-12  # [s]
_MOST_TRIES = 25  # attempts to simplify the start of a misleading run


def scenes(
    robot: Robot, states: Batch, count: int, rng: np.random.Generator
) -> Iterator[Callable[[], tuple[Setup, str]]]:
    """Yield functions that build `count` scenes; the families alternate."""
    scale = np.median(np.diagonal(evaluate(robot, M, {"q": states["q"][:200]}), axis1=-2, axis2=-1), axis=0)
    for k in range(count):
        own = np.random.default_rng(rng.integers(2**63))
        yield partial(_scene, robot, FAMILIES[k % len(FAMILIES)], scale, own)


def _scene(robot: Robot, family: str, scale: np.ndarray, rng: np.random.Generator) -> tuple[Setup, str]:
    """Build a setup, and its description."""
    q, n = robot.random_configuration(rng), robot.n
    v = rng.uniform(-1, 1, n) * np.where(np.isfinite(robot.velocity_limit), np.minimum(robot.velocity_limit, 1.0), 1.0)
    duration = float(np.round(rng.uniform(0.1, 0.3), 3))
    plant, control = Plant(robot, _effects(robot, family, q, scale, rng)), _control(family, q, scale, duration, rng)
    tick = control.period_s if control is not None else 0.0
    record = tick * max(1, round(duration / tick / _RECORDS)) if tick else duration / _RECORDS
    for _ in range(_DRAWS):
        drawn, step = _method(rng)
        try:
            setup = Setup(
                plant, q, v, duration_s=duration, controller=control, method=drawn, record_every_s=record, **step
            )
        except RobotDynError:  # not every method supports every effect
            continue
        steps = f", step {setup.nominal_step_s:g} s" if step else f", rtol {drawn.rtol:.0e}"
        return setup, f"{family}: {setup.method.name}{steps}"
    return Setup(plant, q, v, duration_s=duration, controller=control), f"{family}: auto"


def _effects(robot: Robot, family: str, q: np.ndarray, scale: np.ndarray, rng: np.random.Generator) -> list[Effect]:
    """Effects of a family; some families include the friction stated in the file, if any."""
    stated: list[Effect] = list(Plant(robot, "urdf").effects) if family in ("friction", "PD", "sampled PD") else []
    if family == "friction" and not stated:
        coulomb = RegularisedCoulombFriction(scale * rng.uniform(0.3, 3, robot.n), float(10 ** rng.uniform(-2, -1)))
        return [ViscousFriction(scale * rng.uniform(0.1, 2, robot.n)), coulomb]
    if family == "dry friction":
        return [DryFriction(scale * rng.uniform(0.3, 8, robot.n))]
    if "stops" in family:
        reach = rng.uniform(0.01, 0.3, (2, robot.n))  # small, so that the arm reaches the stops
        lower, upper = np.maximum(robot.lower, q - reach[0]), np.minimum(robot.upper, q + reach[1])
        if family == "rigid stops":
            return [RigidStops(lower, upper, rng.uniform(0, 0.9, robot.n))]
        return list(joint_stops(lower, upper, scale * 10 ** rng.uniform(3, 5), scale * 10 ** rng.uniform(1, 3)))
    return stated


def _control(family: str, q: np.ndarray, scale: np.ndarray, duration: float, rng: np.random.Generator) -> Any:
    if "PD" not in family:
        return None
    period = float(rng.choice([0.001, 0.002, 0.005])) if family == "sampled PD" else 0.0
    plan = quintic(q, q + rng.uniform(-0.3, 0.3, len(q)), duration)
    kp, kd = gains_from(scale, float(rng.uniform(5, 30)), 0.7)
    return PD(plan, kp=kp, kd=kd, period_s=period)


def _method(rng: np.random.Generator) -> tuple[Any, dict[str, Any]]:
    """Draw a random method, with a step or with tolerances."""
    if rng.random() < 0.4:
        rtol = float(f"{10 ** rng.uniform(-10, -5):.0e}")
        return Adaptive(str(rng.choice(["DOP853", "Rodas5P"])), rtol, rtol / 100), {}
    return method(str(rng.choice(_METHODS))), {"step_s": float(np.round(10 ** rng.uniform(-3.3, -2), 5))}


def judged_runs(
    robot: Robot, states: Batch, count: int, rng: np.random.Generator, work: Work
) -> Iterator[JudgedRun | None]:
    """Yield the random runs, None for those that were skipped."""
    for k, build in enumerate(scenes(robot, states, count, rng), 1):
        if work.over:
            work.skip(f"runs {k} to {count}" if k < count else f"run {k}")
            return
        scene = work.do(f"scene of run {k}", lambda _, build=build: build())
        if scene is None:
            continue
        setup, what = scene
        run = work.do(f"run {k}, {what}", partial(compared_run, setup, what))
        yield shrunk_run(run, f"shrinking of run {k}", work) if run is not None and run.misleads else run


def compared_run(setup: Setup, description: str, budget: Budget) -> JudgedRun:
    """Compare a run with two better ones.

    Raises:
        RobotDynError: If a better run fails.
        OvertimeError: If the budget is exceeded.
    """
    run = simulate(setup, on_progress=budget.check)
    finished, error = run.outcome.ending is Ending.FINISHED, run.error
    report = says(run) if finished else f"{run.outcome.ending} at {run.outcome.t:.3g} s"
    if error is None or not finished or not error.until_s:
        return JudgedRun(description, setup.duration_s, np.nan, np.nan, np.nan, report, False, setup)
    sure = replace(setup, step_s=None, estimate_error=False, method=_BETTER[0])
    better = [simulate(replace(sure, method=integrator), on_progress=budget.check) for integrator in _BETTER]
    if any(x.outcome.ending is not Ending.FINISHED for x in better):
        raise RobotDynError("a more accurate run did not finish")
    if any(x.t.shape != run.t.shape or np.abs(x.t - run.t).max() > _ONE_TIME for x in better):
        raise RobotDynError("the more accurate runs have other sample times")
    covered, estimate = run.t <= error.until_s, error.at(error.until_s)
    true, unsure = (float(np.abs(q - better[0].q)[covered].max()) for q in (run.q, better[1].q))
    floor = _ROUNDING * (1 + float(np.abs(run.q).max())) + unsure
    warns = bool(error.note) or "does not close" in run.summary
    misleads = not warns and max(estimate, floor) < LEAST * max(true, floor)
    return JudgedRun(description, setup.duration_s, estimate, true, unsure, report or str(error), misleads, setup)


def shrunk_run(run: JudgedRun, name: str, work: Work) -> JudgedRun:
    """Return a misleading run from a start with fewer digits, or the run itself if the search fails."""
    small = run

    def fails(budget: Budget, x: np.ndarray) -> bool:
        nonlocal small
        q0, v0 = np.split(x, 2)
        try:
            young = compared_run(replace(run.setup, q0=q0, v0=v0), run.description, budget)
        except RobotDynError:
            return False
        small = young if young.misleads else small
        return young.misleads

    start = np.concatenate([run.setup.q0, run.setup.v0])
    work.do(name, lambda budget: shrunk(start, partial(fails, budget), _MOST_TRIES))
    return small
