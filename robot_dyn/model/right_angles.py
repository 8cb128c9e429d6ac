"""Right angles stated with too few digits: rpy = 1.57079632679 means π/2, which gives R its exact zeros.

A literal with nine or more decimals within one unit of its last digit of a multiple of π/2 is replaced by that
multiple. This turns a frame by less than 1e-9 rad, and halves the machine code. Masses, inertias and translations are
unchanged.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, final

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description.description import Description
from robot_dyn.foundations.coefficients import with_values
from robot_dyn.model.robot import Robot

if TYPE_CHECKING:
    from robot_dyn.control.controller import Controller


# With fewer decimals, the intended angle would be a guess, and the change large enough to show in a cross-check.
_MIN_DECIMALS = 9
_FULL = 15  # decimals that need no change


@final
@dataclass(frozen=True)
class RightAngle:
    """A joint whose rpy is replaced by exact right angles.

    Attributes:
        joint: Name of the joint.
        rpy: Angles as stated by the file.
        change: Largest change of an angle, in [rad].
    """

    joint: str
    rpy: str
    change: float

    def __str__(self) -> str:
        return f"joint {self.joint!r}: rpy {self.rpy} taken as right angles ({self.change:.0e} rad)"


def with_exact_right_angles(robot: Robot) -> tuple[Robot, tuple[RightAngle, ...]]:
    """Return the robot with exact right angles, and the changes."""
    description, changes = _written_out(robot.description)
    return (Robot(description, robot.edits) if changes else robot), changes


def with_exact_models(controller: Controller | None, full: Callable[[Robot], Robot]) -> Controller | None:
    """Return a controller with each robot model replaced by `full(model)`; the same controller if none changes."""
    models = {} if controller is None else controller.models
    full_models = {name: full(model) for name, model in models.items() if isinstance(model, Robot)}
    return with_values(controller, {name: robot for name, robot in full_models.items() if robot is not models[name]})


def robot_of(dynamics: object) -> Robot | None:
    """Return the robot of a dynamics object, with exact right angles; None if it has no robot."""
    robot = _described(dynamics)
    return None if robot is None else with_exact_right_angles(robot)[0]


def right_angle_note(*dynamics: object) -> str:
    """Describe the right angles that machine code of these dynamics makes exact, in one sentence, or ""."""
    robots = [robot for item in dynamics if (robot := _described(item)) is not None]
    changes = tuple(dict.fromkeys(change for robot in robots for change in with_exact_right_angles(robot)[1]))
    return _sentence(changes) if changes else ""


def _described(dynamics: object) -> Robot | None:
    robot = getattr(dynamics, "robot", dynamics)
    return robot if isinstance(robot, Robot) and isinstance(robot.description, Description) else None


def _sentence(changes: tuple[RightAngle, ...]) -> str:
    """Describe at least one change in one sentence."""
    names, most = ", ".join(angle.joint for angle in changes), max(angle.change for angle in changes)
    return f"rpy of {names} taken as exact multiples of π/2 (changed by at most {most:.0e} rad)"


@lru_cache(maxsize=32)
def _written_out(description: Description) -> tuple[Description, tuple[RightAngle, ...]]:
    root, changes = description.element, []
    for joint in root.iterfind("joint"):
        origin = joint.find("origin")
        if origin is None:
            continue
        words = origin.get("rpy", "").split()
        full = [_completed(word) for word in words]
        if full != words:
            change = max(abs(float(a) - float(b)) for a, b in zip(words, full, strict=True))
            changes.append(RightAngle(joint.get("name"), " ".join(words), change))
            origin.set("rpy", " ".join(full))
    return (replace(description, xml=etree.tostring(root)) if changes else description), tuple(changes)


def _completed(literal: str) -> str:
    mantissa, _, exponent = literal.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    if exponent or not _MIN_DECIMALS <= decimals < _FULL:
        return literal
    angle = float(literal)
    right = round(angle / (math.pi / 2)) * (math.pi / 2)
    return repr(right) if 0 < abs(angle - right) <= 10.0**-decimals else literal
