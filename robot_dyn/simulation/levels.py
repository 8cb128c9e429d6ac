"""Levels that a run may reach: effort limits and stops that act in the plant, and the limits of the robot's file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.control.controller import Controller
from robot_dyn.effects.actuator import EffortLimit
from robot_dyn.effects.joint_limit import JointStopSpring
from robot_dyn.effects.plant import Plant
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.remarks import Kind

_ROUNDING = 1e-9  # of a limit: nearer to it is at it
_NONE = 1e9  # stops and limits beyond it do not exist


@final
@dataclass(frozen=True)
class Level:
    """A value that a quantity of a joint may pass: above `bound` if `side` is 1, below it if −1.

    Attributes:
        kind: What passing it means.
        row: Of q, v, u one below the other, (3n,).
        side: 1 or −1.
        bound: Where it counts as passed.
        limit: The limit as stated.
    """

    kind: Kind
    row: int
    side: int
    bound: float
    limit: float


def levels(plant: Plant, controller: Controller | None) -> tuple[Level, ...]:
    """All levels of a plant under a controller."""
    return tuple(
        Level(kind, row * plant.dynamics.n + joint, side, float(side * slack + bound), float(bound))
        for kind, row, side, bounds, part in _bounds(plant, controller)
        for joint, bound in enumerate(np.broadcast_to(bounds, plant.dynamics.n))
        if abs(bound) < _NONE
        for slack in (part * max(abs(bound), 1e-3),)
    )


def _bounds(plant: Plant, controller: Controller | None) -> Iterator[tuple[Kind, int, int, np.ndarray, float]]:
    """Kind, 0, 1, 2 for q, v, u, side, bounds (n,), and the part of a bound by which it must be passed."""
    n, robot = plant.dynamics.n, getattr(plant.dynamics, "robot", plant.dynamics)
    effort: Any = np.inf if controller is None else controller.saturation
    for limit in (effect.limit for effect in plant.effects if isinstance(effect, EffortLimit)):
        effort = np.minimum(effort, limit)
    yield from ((Kind.EFFORT_REACHED, 2, side, side * effort, -_ROUNDING) for side in (1, -1))
    lower, upper = np.full(n, -np.inf), np.full(n, np.inf)
    for stop in (effect for effect in plant.effects if isinstance(effect, JointStopSpring)):
        acts = np.broadcast_to(stop.stiffness > 0, n)
        lower = np.where(acts, np.maximum(lower, stop.lower), lower)
        upper = np.where(acts, np.minimum(upper, stop.upper), upper)
    yield Kind.STOP_REACHED, 0, 1, upper, 0.0
    yield Kind.STOP_REACHED, 0, -1, lower, 0.0
    if not isinstance(robot, Robot):
        return
    # a soft stop is overrun a little: what it holds is told as a stop reached; lower = upper = 0: none is stated
    free = robot.lower >= robot.upper
    yield Kind.BEYOND, 0, 1, np.where(free | (upper <= robot.upper + _ROUNDING), np.inf, robot.upper), _ROUNDING
    yield Kind.BEYOND, 0, -1, np.where(free | (lower >= robot.lower - _ROUNDING), -np.inf, robot.lower), _ROUNDING
    for row, stated in ((1, robot.velocity_limit), (2, robot.effort_limit)):
        stated = np.where(stated > 0, stated, np.inf)  # 0: none is stated
        yield from ((Kind.BEYOND, row, side, side * stated, _ROUNDING) for side in (1, -1))
