"""Whether gravity acts on the joints: N(q) = ∂V/∂q is zero at every q for an arm that moves in a horizontal plane."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from robot_dyn.foundations.errors import ModelWarning, RobotDynError

if TYPE_CHECKING:
    from robot_dyn.model.robot import Robot

_STATES = 3  # N is analytic in q: zero at random states, it is zero at all
_ROUNDING = 1e-12  # of the weight times the length of the robot


def gravity_acts(robot: Robot) -> bool:
    """Whether gravity has a torque or force on a joint, at some position."""
    g = float(np.linalg.norm(robot.edits.gravity))
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (_STATES, robot.n))
    length = 1.0 + sum(float(np.linalg.norm(place.translation)) for place in robot.model.jointPlacements)
    length += max(float(np.linalg.norm(body.lever)) for body in robot.model.inertias)
    try:
        return bool(np.abs(robot.N(q)).max() > _ROUNDING * robot.total_mass * g * length)
    except RobotDynError:  # overflows: far from zero
        return True


def no_torque(gravity: tuple[float, float, float]) -> str:
    """The remark on a robot on which a gravity does not act."""
    if not any(gravity):
        return "gravity is zero, so N(q) = 0"
    return f"gravity {gravity} m/s² has no torque on any joint at any position, so N(q) = 0"


def warn_without_torque(robot: Robot) -> None:
    """Warn, at the line that calls the caller, if gravity is not zero and has no torque on any joint."""
    if any(robot.edits.gravity) and not gravity_acts(robot):
        remedy = "give its direction in base axes, or (0, 0, 0)"
        warnings.warn(f"{robot.name}: {no_torque(robot.edits.gravity)}; {remedy}", ModelWarning, stacklevel=3)
