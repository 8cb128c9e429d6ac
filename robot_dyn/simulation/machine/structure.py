"""The structure of a state equation: all that its machine code depends on besides the parameters.

Two setups of one structure run the same code. What cannot be described by values, such as a part of a user's own, is
told by identity.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from enum import Enum
from hashlib import sha256
from typing import Any

import numpy as np

from robot_dyn.coefficients import declared
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.control.samples import Samples
from robot_dyn.model.edits import Edits, Payload
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.state_equation import StateEquation

_PLAIN = bool, int, float, str, bytes, type(None)


def structure(equation: StateEquation) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """The structure of a state equation in hashable values, and the objects that stand in it by identity."""
    objects: list[Any] = []
    parts = equation.plant.dynamics, *equation.plant.effects, equation.controller, *equation.events
    described = tuple(_of(each, objects) for each in parts)
    controller = equation.controller
    period = None
    if controller is not None:  # without states, a sampled controller is one whatever its period
        period = controller.period_s if controller.state_size else controller.period_s > 0
    return (described, period, equation.canonical, equation.limited), tuple(objects)


def _of(value: Any, objects: list[Any]) -> Any:
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, _PLAIN):
        return value
    if isinstance(value, tuple | list):
        return tuple(_of(each, objects) for each in value)
    if isinstance(value, Payload):  # its numbers are those of the bodies
        return "payload", value.frame
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    robot = getattr(value, "robot", value)
    if isinstance(robot, Robot):
        return "robot", sha256(robot.description.xml).digest(), robot.joint_names, _of_edits(robot.edits)
    if type(value) in (PiecewisePolynomial, Samples):  # one of a user's own may be another function of time
        return "polynomial", value.coefficients.shape[1:]
    if is_dataclass(value) and type(value).__module__.startswith("robot_dyn.") and not _holds_function(value):
        return type(value).__qualname__, *(_of_field(value, each.name, objects) for each in fields(value))
    objects.append(value)
    return "object", len(objects)


def _of_field(part: Any, name: str, objects: list[Any]) -> Any:
    """A field of a part of this library: of a parameter, whether it has a value, and the shape if it varies."""
    value = getattr(part, name)
    if name in ("period_s", "seed", "run"):  # of a loop; noise is drawn outside of machine code
        return None
    if name in (known := declared(type(part))):
        return value is None or (None if known[name].of_joints else np.shape(value))
    return _of(value, objects)


def _holds_function(part: Any) -> bool:
    return any(
        callable(getattr(part, each.name)) and not isinstance(getattr(part, each.name), type) for each in fields(part)
    )


def _of_edits(edits: Edits) -> tuple[Any, ...]:
    frames = tuple(each.frame for each in edits.payloads)
    return edits.lock, frames, edits.armature, edits.mass_scale, edits.masses, edits.inertias
