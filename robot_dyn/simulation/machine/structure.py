"""The structure of a state equation: all that its machine code depends on besides the parameters.

Two setups of one structure run the same code. What cannot be described by values, such as a function or the code of a
class that is not of this library, is told by identity.
"""

from __future__ import annotations

from dataclasses import is_dataclass
from enum import Enum
from hashlib import sha256
from typing import Any

import numpy as np

from robot_dyn.coefficients import declared
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.model.dynamics import Dynamics
from robot_dyn.model.edits import Edits, Payload
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.declarations import attributes, is_frozen
from robot_dyn.simulation.state_equation import StateEquation

_PLAIN = bool, int, float, str, bytes, type(None)


def structure(equation: StateEquation) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """The structure of a state equation in hashable values, and the objects that stand in it by identity."""
    objects: list[Any] = []
    described = tuple(_of(each, objects) for each in _parts(equation))
    controller = equation.controller
    period = None
    if controller is not None:  # without states, a sampled controller is one whatever its period
        period = controller.period_s if controller.state_size else controller.period_s > 0
    return (described, period, equation.canonical, equation.limited), tuple(objects)


def changeable(equation: StateEquation) -> tuple[str, ...]:
    """Names of the parts whose code the version of this library does not tell: it may be another at the next run."""

    def by_identity(part: Any) -> bool:
        _of(part, objects := [])
        return bool(objects)

    return tuple(getattr(each, "name", type(each).__name__) for each in _parts(equation) if by_identity(each))


def _parts(equation: StateEquation) -> tuple[Any, ...]:
    return equation.plant.dynamics, *equation.plant.effects, equation.controller, *equation.events


def _of(value: Any, objects: list[Any]) -> Any:
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, _PLAIN):
        return value
    if isinstance(value, tuple | list):
        return tuple(_of(each, objects) for each in value)
    if isinstance(value, Payload):  # its numbers are those of the bodies
        return "payload", value.frame
    if isinstance(value, np.ndarray) and value.dtype != object:
        return value.dtype.str, value.shape, value.tobytes()
    robot = getattr(value, "robot", value)
    if isinstance(robot, Robot) and isinstance(value, Dynamics):
        return "robot", sha256(robot.description.xml).digest(), robot.joint_names, _of_edits(robot.edits)
    if isinstance(value, PiecewisePolynomial) and type(value).at is PiecewisePolynomial.at:
        return "polynomial", value.coefficients.shape[1:]
    if is_dataclass(value) and is_frozen(value):
        inside: list[Any] = []
        described = _class(type(value), inside), *(_of_field(value, name, inside) for name in attributes(value))
        if all(map(_weakly, inside)):
            objects += inside
            return described
    objects.append(value)
    return "object"


def _class(kind: type, objects: list[Any]) -> str:
    if not of_library(kind):
        objects.append(kind)
    return kind.__qualname__


def of_library(kind: type) -> bool:
    """Whether the version of this library tells the code of a class, in another process too."""
    return kind.__module__.startswith("robot_dyn.")


def _weakly(value: Any) -> bool:
    """Whether it can be told by identity for as long as it lives."""
    return type(value).__weakrefoffset__ != 0


def _of_field(part: Any, name: str, objects: list[Any]) -> Any:
    """A field of a part: of a parameter, whether it has a value, and the shape if it varies."""
    value = getattr(part, name)
    if name in ("period_s", "seed", "run") and of_library(type(part)):  # noise is drawn outside of machine code
        return None
    if name in (known := declared(type(part))):
        return value is None or (None if known[name].of_joints else np.shape(value))
    return _of(value, objects)


def _of_edits(edits: Edits) -> tuple[Any, ...]:
    frames = tuple(each.frame for each in edits.payloads)
    return edits.lock, frames, edits.armature, edits.mass_scale, edits.masses, edits.inertias
