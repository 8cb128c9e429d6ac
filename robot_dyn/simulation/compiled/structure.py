"""The structure of a state equation: everything its machine code depends on other than the parameters.

Setups of equal structure run the same code. User-defined code is identified by the object, because it may change, and
by its source if there is one, which identifies it also in another process.
"""

from __future__ import annotations

from dataclasses import dataclass, field, is_dataclass
from enum import Enum
from hashlib import sha256
from typing import Any, NamedTuple, final

import numpy as np

from robot_dyn.codegen.store.definition import definition
from robot_dyn.control.controller import Controller
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.description.edits import Edits
from robot_dyn.effects.carried_payload import CarriedPayload
from robot_dyn.foundations.coefficients import declared
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.simulation.dynamics.declarations import attributes, is_frozen
from robot_dyn.simulation.dynamics.state_equation import StateEquation

_PLAIN = bool, int, float, str, bytes, type(None)


class Structure(NamedTuple):
    """The structure of a state equation.

    Attributes:
        described: The structure in hashable values.
        objects: Objects that are described by identity.
        lasting: True if `described` identifies the equation also in another process.
    """

    described: tuple[object, ...]
    objects: tuple[object, ...]
    lasting: bool


def structure(equation: StateEquation) -> Structure:
    """Return the structure of a state equation."""
    description = _Description()
    described = tuple(description.of_part(part) for part in _parts(equation))
    controller = equation.controller
    period = None
    if controller is not None:  # the period matters only to a controller with states
        period = controller.period_s if controller.state_size else controller.period_s > 0
    whole = described, period, equation.canonical, equation.limited
    return Structure(whole, tuple(description.objects), description.lasting)


def changeable(equation: StateEquation) -> tuple[str, ...]:
    """Return the names of the parts with user-defined code, which may change between runs."""

    def by_identity(part: Any) -> bool:
        description = _Description()
        description.of_part(part)
        return bool(description.objects)

    return tuple(getattr(part, "name", type(part).__name__) for part in _parts(equation) if by_identity(part))


def _parts(equation: StateEquation) -> tuple[Any, ...]:
    return equation.plant.dynamics, *equation.plant.effects, equation.controller, *equation.events


def _numbered(part: Any) -> frozenset[str]:
    """Return the paths in a part of objects whose numbers are parameters, or numbers of a segment; models excluded."""
    if not isinstance(part, Controller):
        return frozenset([""])
    references = part.references
    pieces = (f"{name}.{attribute}" for name, x in references.items() for attribute in x.polynomials if attribute)
    return frozenset(["", *(block.path for block in part.parts), *references, *pieces])


@final
@dataclass
class _Description:
    """A description of parts in hashable values.

    Attributes:
        part: The part being described.
        numbered: Paths in it of objects whose numbers are inputs of the code, see `_numbered`.
        objects: Objects that are described by identity so far.
        lasting: True if all of these have a source.
    """

    part: Any = None
    numbered: frozenset[str] = frozenset()
    objects: list[Any] = field(default_factory=list)
    lasting: bool = True

    def of_part(self, part: Any) -> Any:
        """Return a part in hashable values."""
        self.part, self.numbered = part, _numbered(part)
        return self._of(part, "")

    def _of(self, value: Any, path: str) -> Any:
        kind: Any = type(value)
        if issubclass(kind, Enum) and of_library(kind):
            return value.name
        if kind in _PLAIN:
            return kind.__name__, repr(value)  # -0.0 is another number than 0.0, and 1 than True
        if kind in (tuple, list):
            return tuple(self._of(x, f"{path}.{i}") for i, x in enumerate(value))
        if issubclass(kind, np.generic) or (kind is np.ndarray and not value.dtype.hasobject):
            return value.dtype.str, value.shape, value.tobytes()
        robot = getattr(value, "robot", value)
        if isinstance(robot, Robot) and of_library(kind) and isinstance(value, Dynamics):
            edits = _of_edits(robot.edits) if self._is_model(path) else self._of(robot.edits, "edits")
            return kind.__name__, sha256(robot.description.xml).digest(), robot.joint_names, edits
        if path in self.numbered and _is_polynomial(value):
            return "polynomial", value.coefficients.shape[1:]
        if is_dataclass(value) and is_frozen(value):
            before = len(self.objects)
            name = kind.__qualname__ if of_library(kind) else self._by_identity(kind)
            described = name, *(self._of_field(value, name, path) for name in attributes(value))
            if all(type(x).__weakrefoffset__ for x in self.objects[before:]):  # weak references to them are possible
                return described
            del self.objects[before:]
        return self._by_identity(value)

    def _is_model(self, path: str) -> bool:
        """Return True if the numbers of the robot at a path are among the parameters."""
        return path in self.numbered or (isinstance(self.part, Controller) and path in self.part.models)

    def _by_identity(self, value: Any) -> tuple[str, str | None]:
        """Return a value described by identity and, if possible, by its source."""
        self.objects.append(value)
        source = definition(value)
        self.lasting &= source is not None
        return type(value).__name__, source

    def _of_field(self, part: Any, name: str, path: str) -> Any:
        """Return a field of a part; of a parameter, only True for None, or the shape if it may vary."""
        value: Any = getattr(part, name)
        if name in ("period_s", "seed", "run") and of_library(
            type(part)
        ):  # the time loop draws noise, not the traced equation
            return None
        if name == "payload" and isinstance(part, CarriedPayload):  # its numbers are parameters of the arm
            return "payload", value.frame
        if name in (coefficients := declared(type(part))) and path in self.numbered:
            return value is None or (None if coefficients[name].is_per_joint else np.shape(value))
        return self._of(value, f"{path}.{name}" if path else name)


def of_library(kind: type) -> bool:
    """Return True for a class of this library, whose version identifies its code also in another process."""
    return kind.__module__.startswith("robot_dyn.")


def _is_polynomial(value: Any) -> bool:
    return isinstance(value, PiecewisePolynomial) and type(value).at is PiecewisePolynomial.at


def _of_edits(edits: Edits) -> tuple[Any, ...]:
    frames = tuple(payload.frame for payload in edits.payloads)
    return edits.lock, frames, edits.armature, edits.mass_scale, edits.mass_scales, edits.masses, edits.inertias
