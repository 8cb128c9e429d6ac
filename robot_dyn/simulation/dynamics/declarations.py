"""Declarations of the parts of a setup: where their formulas are not smooth, and that a run leaves them unchanged.

    effect, controller    `thresholds`, () if it is smooth everywhere
    block                 `rounds`, True if its output jumps
    reference             `knots`, if it defines `at`

engine="auto" compiles only parts with these declarations; methods keep their order between the thresholds. Nothing is
assumed about any other part.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from enum import Enum
from numbers import Number
from typing import Any

import numpy as np

from robot_dyn.control.controller import Controller
from robot_dyn.control.digital_loop.block import Block
from robot_dyn.control.reference import Reference
from robot_dyn.effects.effect import Effect
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.coefficients import cached_properties
from robot_dyn.model.robot import Robot

_MUTABLE = list, dict, set, bytearray


def undeclared(plant: Plant, controller: Controller | None) -> tuple[tuple[object, str], ...]:
    """Return the parts that lack a declaration, each with a text: the declaration that is missing and the remedy."""
    parts = [*plant.effects]
    if controller is not None:
        parts += [controller, *(block.part for block in controller.parts), *controller.references.values()]
    models = [plant.dynamics, *(controller.models.values() if controller is not None else ())]
    pairs = [(part, _missing(part)) for part in parts] + [(model, _not_a_robot(model)) for model in models]
    return tuple((part, missing) for part, missing in pairs if missing)


def named(part: object) -> str:
    """Return the name of a part in messages: its class; for a controller of a function, the name of the function."""
    return part.name if isinstance(part, Controller) else type(part).__name__


def is_frozen(part: object) -> bool:
    """Return True if all attributes are fields of a frozen dataclass; values derived from these may be cached."""
    return next(_not_frozen(part), None) is None


def is_value(part: object) -> bool:
    """Return True if a part cannot change: it is a value of this library, and so are all its attributes.

    False for a robot with a check of its results, because each run must warn again.
    """
    if isinstance(part, tuple):
        return all(map(is_value, part))
    if isinstance(part, np.ndarray):
        return not part.flags.writeable and (part.dtype != object or all(map(is_value, part.flat)))
    if part is None or isinstance(part, Number | str | bytes | Enum):
        return True
    if not type(part).__module__.startswith("robot_dyn.") or not is_frozen(part):
        return False
    if isinstance(part, Robot):
        return part.answer_check is None
    caches = {field.name for field in fields(part) if not field.compare} if is_dataclass(part) else set()
    return all(is_value(getattr(part, x)) for x in attributes(part) if x not in caches)


def _missing(part: Any) -> str:
    """Return the declaration that a part lacks, with the remedy; empty if it lacks none."""
    kind = type(part)
    if isinstance(part, Effect) and not _defines(kind, "thresholds", Effect):
        return "declares no thresholds: define thresholds(self, n), which returns () if it is smooth everywhere"
    if isinstance(part, Controller) and not _defines(kind, "thresholds", Controller):
        return (
            "declares no thresholds: give a class, such as rd.control.Stateless, with thresholds(self), which returns"
            " () if it is smooth everywhere"
        )
    if isinstance(part, Block) and not _defines(kind, "rounds", Block):
        return "does not declare whether its output jumps: define rounds, True or False"
    if isinstance(part, Reference) and _definer(kind, "at") < _definer(kind, "knots"):
        return "declares no knots for its own at(t): define knots, the times at which it is not smooth"
    if name := next(_not_frozen(part), ""):
        return f"may change its attribute {name!r} in a run: make it a frozen dataclass, with that as a field"
    if name := next((name for name in attributes(part) if isinstance(getattr(part, name, None), _MUTABLE)), ""):
        return f"may change the content of its attribute {name!r}: make that a tuple or an array, or declare states"
    return ""


def _not_a_robot(dynamics: Any) -> str:
    """Return the message for dynamics that are not those of a `Robot`; empty for a `Robot`."""
    robot = getattr(dynamics, "robot", dynamics)
    return "" if isinstance(robot, Robot) else "is not a Robot: give a Robot"


def attributes(part: object) -> tuple[str, ...]:
    """Return the names of the attributes that a part depends on: all but its cached properties."""
    derived = cached_properties(part)
    others = (name for name in getattr(part, "__dict__", ()) if name not in derived)
    return tuple(dict.fromkeys([*_fields(type(part)), *others]))


def _fields(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind)) if is_dataclass(kind) else ()


def _not_frozen(part: Any) -> Iterator[str]:
    """Yield the attributes that code may set after construction, except those that `Controller` declares."""
    kind = type(part)
    is_frozen = is_dataclass(kind) and kind.__dataclass_params__.frozen  # pyright: ignore[reportAttributeAccessIssue]
    constant = set(_fields(kind)) if is_frozen else set()
    constant |= vars(Controller)["__annotations__"].keys() if isinstance(part, Controller) else set()
    return (name for name in attributes(part) if name not in constant)


def _defines(kind: type, name: str, base: type) -> bool:
    """Return True if a class, or one between it and the interface `base`, defines the attribute `name`."""
    return _definer(kind, name) < kind.__mro__.index(base)


def _definer(kind: type, name: str) -> int:
    """Return the place, in the order of inheritance, of the class whose definition of `name` applies."""
    return next((i for i, base in enumerate(kind.__mro__) if name in vars(base)), len(kind.__mro__))
