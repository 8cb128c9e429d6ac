"""What the parts of a setup declare: where their formulas are smooth, and that nothing in them changes during a run.

    effect, controller    `thresholds`, () where it is smooth everywhere
    block                 `rounds`: whether its output jumps
    reference             `knots`, beside its own `at`

A part that declares this may be compiled unasked, and methods keep their order between its thresholds. Nothing is
presumed of any other part, whoever wrote it.
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

_CHANGING = list, dict, set, bytearray


def undeclared(plant: Plant, controller: Controller | None) -> tuple[tuple[Any, str], ...]:
    """Parts that do not declare what they must, each with what to declare."""
    parts = [*plant.effects]
    if controller is not None:
        parts += [controller, *(each.part for each in controller.parts), *controller.references.values()]
    found = [(part, _missing(part)) for part in parts]
    bodies = [plant.dynamics, *(controller.models.values() if controller is not None else ())]
    found += [(each, _of_no_file(each)) for each in bodies]
    return tuple((part, why) for part, why in found if why)


def named(part: Any) -> str:
    """Its name for people: that of its class, or of the function that it is."""
    return part.name if isinstance(part, Controller) else type(part).__name__


def is_frozen(part: Any) -> bool:
    """Whether all its attributes are fields of a frozen dataclass; what follows from these may be cached."""
    return next(_not_frozen(part), None) is None


def is_value(part: Any) -> bool:
    """Whether nothing can change what a part is: a value of this library, as is all that it holds.

    A robot with a check of its answers is none: it is to warn in each run.
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
    caches = {each.name for each in fields(part) if not each.compare}
    return all(is_value(getattr(part, x)) for x in attributes(part) if x not in caches)


def _missing(part: Any) -> str:
    """What a part still has to declare; empty if nothing."""
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
    if name := next((name for name in attributes(part) if isinstance(getattr(part, name, None), _CHANGING)), ""):
        return f"may change what its attribute {name!r} holds: make that a tuple or an array, or declare states"
    return ""


def _of_no_file(dynamics: Any) -> str:
    robot = getattr(dynamics, "robot", dynamics)
    return "" if isinstance(robot, Robot) else "comes from no robot's file: give a Robot"


def attributes(part: Any) -> tuple[str, ...]:
    """Names of the attributes that it depends on; what is cached follows from them."""
    follows = cached_properties(part)
    own = (name for name in getattr(part, "__dict__", ()) if name not in follows)
    return tuple(dict.fromkeys([*_fields(type(part)), *own]))


def _fields(kind: type) -> tuple[str, ...]:
    return tuple(each.name for each in fields(kind)) if is_dataclass(kind) else ()


def _not_frozen(part: Any) -> Iterator[str]:
    """Attributes that code may set after construction; the period of a controller is set by its interface."""
    kind = type(part)
    frozen = is_dataclass(kind) and kind.__dataclass_params__.frozen  # pyright: ignore[reportAttributeAccessIssue]
    known = set(_fields(kind)) if frozen else set()
    known |= vars(Controller)["__annotations__"].keys() if isinstance(part, Controller) else set()
    return (name for name in attributes(part) if name not in known)


def _defines(kind: type, name: str, base: type) -> bool:
    """Whether a class, or one between it and an interface, has a definition of its own."""
    return _definer(kind, name) < kind.__mro__.index(base)


def _definer(kind: type, name: str) -> int:
    """The number of the class, in the order of inheritance, whose definition counts."""
    return next((i for i, each in enumerate(kind.__mro__) if name in vars(each)), len(kind.__mro__))
