"""The structure of a state equation: all that its machine code depends on besides the parameters.

Two setups of one structure run the same code. User-defined code is identified by the object, since it may change,
and by its definition where it has one, which identifies it in another process too.
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
        described: In hashable values.
        objects: What stands in it by identity.
        lasting: Whether `described` identifies all of it, in another process too.
    """

    described: tuple[Any, ...]
    objects: tuple[Any, ...]
    lasting: bool


def structure(equation: StateEquation) -> Structure:
    """The structure of a state equation."""
    found = _Found()
    described = tuple(found.of_part(each) for each in _parts(equation))
    controller = equation.controller
    period = None
    if controller is not None:  # without states, a sampled controller is one whatever its period
        period = controller.period_s if controller.state_size else controller.period_s > 0
    whole = described, period, equation.canonical, equation.limited
    return Structure(whole, tuple(found.objects), found.lasting)


def changeable(equation: StateEquation) -> tuple[str, ...]:
    """Names of the parts whose code the version of this library does not identify: it may change from run to run."""

    def by_identity(part: Any) -> bool:
        found = _Found()
        found.of_part(part)
        return bool(found.objects)

    return tuple(getattr(each, "name", type(each).__name__) for each in _parts(equation) if by_identity(each))


def _parts(equation: StateEquation) -> tuple[Any, ...]:
    return equation.plant.dynamics, *equation.plant.effects, equation.controller, *equation.events


def _numbered(part: Any) -> frozenset[str]:
    """Paths in a part to what has its numbers in the parameters, or in those of a segment; beside models of the arm."""
    if not isinstance(part, Controller):
        return frozenset([""])
    followed = part.references
    pieces = (f"{name}.{attribute}" for name, each in followed.items() for attribute in each.polynomials if attribute)
    return frozenset(["", *(each.path for each in part.parts), *followed, *pieces])


@final
@dataclass
class _Found:
    """Descriptions of parts.

    Attributes:
        part: The one that is described.
        numbered: Paths in it to what has its numbers elsewhere.
        objects: What stands in the descriptions by identity.
        lasting: Whether these have definitions.
    """

    part: Any = None
    numbered: frozenset[str] = frozenset()
    objects: list[Any] = field(default_factory=list)
    lasting: bool = True

    def of_part(self, part: Any) -> Any:
        """A part in hashable values."""
        self.part, self.numbered = part, _numbered(part)
        return self._of(part, "")

    def _of(self, value: Any, path: str) -> Any:
        kind: Any = type(value)
        if issubclass(kind, Enum) and of_library(kind):
            return value.name
        if kind in _PLAIN:
            return kind.__name__, repr(value)  # -0.0 is another number than 0.0, and 1 than True
        if kind in (tuple, list):
            return tuple(self._of(each, f"{path}.{i}") for i, each in enumerate(value))
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
            if all(type(each).__weakrefoffset__ for each in self.objects[before:]):  # weak references identify them
                return described
            del self.objects[before:]
        return self._by_identity(value)

    def _is_model(self, path: str) -> bool:
        """Whether the numbers of a robot are among the parameters."""
        return path in self.numbered or (isinstance(self.part, Controller) and path in self.part.models)

    def _by_identity(self, value: Any) -> tuple[str, str | None]:
        self.objects.append(value)
        defined = definition(value)
        self.lasting &= defined is not None
        return type(value).__name__, defined

    def _of_field(self, part: Any, name: str, path: str) -> Any:
        """A field of a part: of a parameter, whether it has a value, and the shape if it varies."""
        value: Any = getattr(part, name)
        if name in ("period_s", "seed", "run") and of_library(type(part)):  # noise is drawn outside of machine code
            return None
        if name == "payload" and isinstance(part, CarriedPayload):  # its numbers are those of the bodies
            return "payload", value.frame
        if name in (known := declared(type(part))) and path in self.numbered:
            return value is None or (None if known[name].of_joints else np.shape(value))
        return self._of(value, f"{path}.{name}" if path else name)


def of_library(kind: type) -> bool:
    """Whether the version of this library identifies the code of a class, in another process too."""
    return kind.__module__.startswith("robot_dyn.")


def _is_polynomial(value: Any) -> bool:
    return isinstance(value, PiecewisePolynomial) and type(value).at is PiecewisePolynomial.at


def _of_edits(edits: Edits) -> tuple[Any, ...]:
    frames = tuple(each.frame for each in edits.payloads)
    return edits.lock, frames, edits.armature, edits.mass_scale, edits.masses, edits.inertias
