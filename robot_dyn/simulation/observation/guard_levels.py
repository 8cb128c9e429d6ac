"""Levels that a run may reach: effort limits and stops that act in the plant, and the limits of the robot's file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, final

import numpy as np

from robot_dyn.control.controller import Controller
from robot_dyn.effects.effect import Bound, Effect
from robot_dyn.effects.joint_limit import JointStopSpring
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.simulation.observation.remarks import RemarkKind

_ROUNDING = 1e-9  # fraction of a limit: a smaller distance counts as reached
_NONE = 1e9  # larger stops and limits mean none


@final
@dataclass(frozen=True)
class Level:
    """A value that a quantity of a joint may pass: upwards if `side` is 1, downwards if −1.

    Attributes:
        kind: Kind of the remark if it is passed.
        row: Row in q, v, u stacked, (3n,).
        side: 1 or −1.
        limit: The limit as stated.
    """

    kind: RemarkKind
    row: int
    side: int
    limit: float


class GuardLevels(NamedTuple):
    """L levels of W runs.

    Attributes:
        levels: Levels in the order of rows, with the limits of the first run that has them.
        limits: Stated limits of each run, (L, W); nan for none.
        bounds: Values beyond which they count as passed, (L, W).
    """

    levels: tuple[Level, ...]
    limits: Array
    bounds: Array

    def of_runs(self, numbers: np.ndarray | list[int]) -> GuardLevels:
        """Return the levels of some of the runs."""
        return GuardLevels(self.levels, self.limits[:, numbers], self.bounds[:, numbers])


NO_LEVELS = GuardLevels((), np.empty((0, 1)), np.empty((0, 1)))


def guard_levels(
    dynamics: Dynamics, effects: Iterable[Effect], controller: Controller | None, W: int = 1
) -> GuardLevels:
    """Return all levels of a plant under a controller.

    Args:
        dynamics: The rigid bodies.
        effects: Effects; their coefficients, and those of the controller, may be arrays over runs, (W, n) or (W, 1).
        controller: The controller, or None.
        W: Number of runs.
    """
    n, rows = dynamics.n, []
    for kind, row, side, bounds, part in _bounds(dynamics, tuple(effects), controller):
        by_run = np.atleast_2d(bounds)
        for joint, limits in enumerate(np.broadcast_to(by_run, (len(by_run), n)).T):
            exists = np.abs(limits) < _NONE
            if exists.any():
                limits = np.where(exists, limits, np.nan)
                slack = part * np.maximum(np.abs(limits), 1e-3)
                level = Level(kind, row * n + joint, side, float(limits[exists][0]))
                rows.append((level, limits, side * slack + limits))
    if not rows:
        return GuardLevels((), np.empty((0, W)), np.empty((0, W)))
    levels, *arrays = zip(*sorted(rows, key=lambda row: row[0].row), strict=True)
    limits, bounds = (np.array([np.broadcast_to(x, W) for x in array]) for array in arrays)
    return GuardLevels(levels, limits, bounds)


def _bounds(
    dynamics: Dynamics, effects: tuple[Effect, ...], controller: Controller | None
) -> Iterator[tuple[RemarkKind, int, int, np.ndarray, float]]:
    """Yield kind, 0, 1, 2 for q, v, u, side, bounds (n,) or (W, n), and the relative excess that counts as passed."""
    n, robot = dynamics.n, getattr(dynamics, "robot", dynamics)
    effort: Any = np.inf if controller is None else controller.saturation
    for limit in (effect.largest for effect in effects if isinstance(effect, Bound)):
        effort = np.minimum(effort, limit)
    yield from ((RemarkKind.EFFORT_REACHED, 2, side, side * effort, -_ROUNDING) for side in (1, -1))
    lower, upper = np.full(n, -np.inf), np.full(n, np.inf)
    for stop in (effect for effect in effects if isinstance(effect, JointStopSpring)):
        acts = stop.stiffness > 0
        lower = np.where(acts, np.maximum(lower, stop.lower), lower)
        upper = np.where(acts, np.minimum(upper, stop.upper), upper)
    yield RemarkKind.STOP_REACHED, 0, 1, upper, 0.0
    yield RemarkKind.STOP_REACHED, 0, -1, lower, 0.0
    if not isinstance(robot, Robot):
        return
    # motion exceeds a soft stop slightly, which is reported as a stop reached; lower = upper = 0: no limit stated
    free = robot.lower >= robot.upper
    yield RemarkKind.BEYOND, 0, 1, np.where(free | (upper <= robot.upper + _ROUNDING), np.inf, robot.upper), _ROUNDING
    yield RemarkKind.BEYOND, 0, -1, np.where(free | (lower >= robot.lower - _ROUNDING), -np.inf, robot.lower), _ROUNDING
    for row, stated in ((1, robot.velocity_limit), (2, robot.effort_limit)):
        stated = np.where(stated > 0, stated, np.inf)  # 0: no limit stated
        yield from ((RemarkKind.BEYOND, row, side, side * stated, _ROUNDING) for side in (1, -1))
