"""Random scenes of an arm: a free swing, friction, stops, and control, with a random method."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, final

import numpy as np

from robot_dyn import Plant, Robot, RobotDynError, Setup
from robot_dyn.accuracy import Batch, evaluate
from robot_dyn.control import PD, gains_from, quintic
from robot_dyn.effects import DryFriction, Effect, RegularisedCoulombFriction, RigidStops, ViscousFriction, joint_stops
from robot_dyn.integrate import Adaptive, method
from robot_dyn.queries import M

FAMILIES = ("swing", "friction", "dry friction", "stops", "rigid stops", "PD", "sampled PD")
_METHODS = ("explicit_euler", "semi_implicit_euler", "midpoint", "rk4", "order_8", "gauss_4", "rosenbrock_5")
_DRAWS = 20  # attempts to draw a method that the scene accepts
_RECORDS = 20


@final
@dataclass(frozen=True)
class Scene:
    """A setup, and a description of what acts in it."""

    setup: Setup
    what: str


def scenes(robot: Robot, states: Batch, count: int, rng: np.random.Generator) -> Iterator[Callable[[], Scene]]:
    """Yield `count` scenes, each built when called; the families take turns."""
    scale = np.median(np.diagonal(evaluate(robot, M, {"q": states["q"][:200]}), axis1=-2, axis2=-1), axis=0)
    for k in range(count):
        own = np.random.default_rng(rng.integers(2**63))
        yield partial(_scene, robot, FAMILIES[k % len(FAMILIES)], scale, own)


def _scene(robot: Robot, family: str, scale: np.ndarray, rng: np.random.Generator) -> Scene:
    q, n = robot.random_configuration(rng), robot.n
    v = rng.uniform(-1, 1, n) * np.where(np.isfinite(robot.velocity_limit), np.minimum(robot.velocity_limit, 1.0), 1.0)
    duration = float(np.round(rng.uniform(0.1, 0.3), 3))
    effects, control = _effects(robot, family, q, scale, rng), _control(family, q, scale, duration, rng)
    tick = control.period_s if control is not None else 0.0
    record = tick * max(1, round(duration / tick / _RECORDS)) if tick else duration / _RECORDS
    for _ in range(_DRAWS):
        made, step = _method(rng)
        try:
            setup = Setup(Plant(robot, effects), q, v, duration, control, made, record_period_s=record, **step)
        except RobotDynError:  # not every method supports every effect
            continue
        steps = f", step {setup.nominal_step_s:g} s" if step else f", rtol {setup.integrator.rtol:.0e}"
        return Scene(setup, f"{family}: {setup.integrator.name}{steps}")
    return Scene(Setup(Plant(robot, effects), q, v, duration, control), f"{family}: auto")


def _effects(robot: Robot, family: str, q: np.ndarray, scale: np.ndarray, rng: np.random.Generator) -> list[Effect]:
    """Effects of a family; some families include the friction stated in the file, if any."""
    stated: list[Effect] = list(Plant(robot, "urdf").effects) if family in ("friction", "PD", "sampled PD") else []
    if family == "friction" and not stated:
        coulomb = RegularisedCoulombFriction(scale * rng.uniform(0.3, 3, robot.n), float(10 ** rng.uniform(-2, -1)))
        return [ViscousFriction(scale * rng.uniform(0.1, 2, robot.n)), coulomb]
    if family == "dry friction":
        return [DryFriction(scale * rng.uniform(0.3, 8, robot.n))]
    if "stops" in family:
        reach = rng.uniform(0.01, 0.3, (2, robot.n))  # within the file's limits, so that the arm reaches the stops
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
    return PD(plan, *gains_from(scale, float(rng.uniform(5, 30)), 0.7), period_s=period)


def _method(rng: np.random.Generator) -> tuple[Any, dict[str, Any]]:
    """A random method, with a step or with tolerances."""
    if rng.random() < 0.4:
        rtol = float(f"{10 ** rng.uniform(-10, -5):.0e}")
        return Adaptive(str(rng.choice(["DOP853", "Rosenbrock"])), rtol, rtol / 100), {}
    return method(str(rng.choice(_METHODS))), {"step_s": float(np.round(10 ** rng.uniform(-3.3, -2), 5))}
