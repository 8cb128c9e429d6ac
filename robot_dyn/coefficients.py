"""Declared coefficients: the numbers of an effect, a controller or a reference, each with unit, sign and meaning.

    damping: Any = field(metadata=coefficient("N m s/rad", symbol="b", least=0, stated="damping"))

From the declaration follow its checks, values by joint name and "urdf", its key in scenes, its name in sweeps, and
that machine code takes it as an input.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass, replace
from functools import cache, cached_property
from inspect import getattr_static
from typing import Any, final

import numpy as np

from robot_dyn.errors import EffectError, RobotDynError, nearest, shown
from robot_dyn.validate import instance, number, numbers, truth

URDF = "urdf"  # in place of a coefficient: what the robot's file states
_KEY = "robot_dyn.coefficients"
JOINTS = ((), ("n",))  # one number for all joints, or one for each


@final
@dataclass(frozen=True)
class Coefficient:
    """What is declared of a coefficient.

    Attributes:
        unit: For a revolute joint, such as "N m s/rad"; "" for a number without.
        symbol: As in the equation, such as "b".
        shapes: Shapes it may have; a text stands for any length.
        least, above: What it must not be less than, and must be greater than; None for any.
        infinite: Whether ±inf is taken.
        elsewhere: Its value for joints that are not named.
        stated: The attribute of a `Robot` that "urdf" stands for; "" if files state none.
        swept: Whether it may differ from run to run in `rollouts`.
    """

    unit: str = ""
    symbol: str = ""
    shapes: tuple[tuple[int | str, ...], ...] = JOINTS
    least: float | None = None
    above: float | None = None
    infinite: bool = False
    elsewhere: float = 0.0
    stated: str = ""
    swept: bool = True

    def __post_init__(self) -> None:
        for name in ("unit", "symbol", "stated"):
            instance(name, getattr(self, name), str, "give a text, such as 'N m'", error=EffectError)
        for name in ("infinite", "swept"):
            truth(name, getattr(self, name), error=EffectError)
        for name in ("least", "above"):
            if getattr(self, name) is not None:
                number(name, getattr(self, name), error=EffectError)
        number("elsewhere", self.elsewhere, error=EffectError, infinite=True)
        shapes = self.shapes
        if not isinstance(shapes, tuple) or not all(isinstance(x, tuple) for x in shapes) or not shapes:
            raise EffectError(f"shapes must be tuples, such as ((), ('n',)), got {shown(shapes)}")

    @property
    def of_joints(self) -> bool:
        """Whether it is one number for all joints, or one for each."""
        return self.shapes == JOINTS

    def checked(self, name: str, values: Any, *, error: type[RobotDynError], resolved: bool) -> Any:
        """The numbers, copied and frozen, or a float.

        Values by joint name and "urdf" stay until the joints are known, where they are `resolved` later, by `on`.

        Raises:
            RobotDynError: If they have another shape, a wrong sign, or are not finite; of the class `error`.
        """
        if resolved and self.of_joints and isinstance(values, Mapping):
            if not values:
                raise error(f"{name} names no joint; give values by joint, or one for all")
            return values
        if resolved and self.stated and isinstance(values, str) and values == URDF:
            return URDF
        found = numbers(
            name, values, *self.shapes, error=error, least=self.least, above=self.above, infinite=self.infinite
        )
        return float(found) if self.shapes == ((),) else found

    def on(self, name: str, values: Any, dynamics: Any) -> Any:
        """The numbers for the joints of an arm: of names and "urdf", an array (n,).

        Raises:
            EffectError: If a joint is unknown, no file states it, or they are of another number of joints.
        """
        names = dynamics.joint_names
        if isinstance(values, Mapping):
            for joint in values.keys() - set(names):
                raise EffectError(f"{name}: no joint {joint!r}; {nearest(str(joint), names)}")
            return [values.get(joint, self.elsewhere) for joint in names]
        if values is URDF:
            return self._stated(name, dynamics)
        if self.of_joints and np.ndim(values) and np.shape(values) != (len(names),):
            count = f"{len(values)} joint{'s' if len(values) > 1 else ''}"
            raise EffectError(
                f"{name} is of {count}, the arm has {len(names)}; give one number for all, or one for each joint"
            )
        return values

    def _stated(self, name: str, dynamics: Any) -> Any:
        try:
            stated = getattr(dynamics, self.stated)
        except AttributeError:
            raise EffectError(f"{name}='urdf' needs a Robot, got {type(dynamics).__name__}") from None
        if np.all(stated == self.elsewhere):
            raise EffectError(
                f"{name}='urdf' has no effect: the file of {dynamics.name} states none for any joint; give"
                " numbers, or leave the effect out"
            )
        return stated


def coefficient(
    unit: str = "",
    *,
    symbol: str = "",
    shapes: tuple[tuple[int | str, ...], ...] = JOINTS,
    least: float | None = None,
    above: float | None = None,
    infinite: bool = False,
    elsewhere: float = 0.0,
    stated: str = "",
    swept: bool = True,
) -> Mapping[str, Coefficient]:
    """The metadata of a dataclass field that is a coefficient; arguments as of `Coefficient`."""
    return {_KEY: Coefficient(unit, symbol, shapes, least, above, infinite, elsewhere, stated, swept)}


@cache
def declared(kind: type) -> Mapping[str, Coefficient]:
    """The coefficients that a class declares, by name."""
    return {each.name: each.metadata[_KEY] for each in _fields(kind) if _KEY in each.metadata}


@cache
def defaults(kind: type) -> Mapping[str, Any]:
    """The default of each coefficient of a class that has one."""
    known = declared(kind)
    return {each.name: each.default for each in _fields(kind) if each.name in known and each.default is not MISSING}


def _fields(kind: type) -> tuple[Field[Any], ...]:
    return fields(kind) if is_dataclass(kind) else ()


def check_coefficients(part: Any, error: type[RobotDynError], *, resolved: bool = False) -> None:
    """Check and freeze the coefficients of a part under construction; see `Coefficient.checked`."""
    for name, each in declared(type(part)).items():
        if getattr(part, name) is None and defaults(type(part)).get(name, 0) is None:
            continue  # it may be left out
        object.__setattr__(part, name, each.checked(name, getattr(part, name), error=error, resolved=resolved))


def with_values(part: Any, values: Mapping[str, Any]) -> Any:
    """A copy of a part with other coefficients, such as symbols, which its own checks would refuse.

    A name may be a path to a part of it, as "controller.kp" or "position.0.resolution".
    """
    if not values:
        return part
    changed, inside = copy(part), _by_head(values)
    if declared(type(part)).keys() & values.keys():
        for name in cached_properties(changed):  # it may follow from them
            del vars(changed)[name]
    for name, value in values.items():
        if "." not in name:
            object.__setattr__(changed, name, value)
    for head, below in inside.items():
        object.__setattr__(changed, head, _within(getattr(changed, head), below, with_values))
    return changed


def cached_properties(part: Any) -> tuple[str, ...]:
    """Names of its cached properties that were read."""
    known, kind = getattr(part, "__dict__", ()), type(part)
    return tuple(name for name in known if isinstance(getattr_static(kind, name, None), cached_property))


def rebuilt(part: Any, values: Mapping[str, Any]) -> Any:
    """A copy of a part with other coefficients, built so that its checks apply."""
    inside = {head: _within(getattr(part, head), below, rebuilt) for head, below in _by_head(values).items()}
    return replace(part, **{name: value for name, value in values.items() if "." not in name}, **inside)


def value_at(part: Any, path: str) -> Any:
    """The attribute of a part at a path."""
    for name in path.split("."):
        part = part[int(name)] if isinstance(part, tuple) else getattr(part, name)
    return part


def _by_head(values: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Of values by path, those inside a part: by its attribute, then by the rest of the path."""
    parts: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        head, _, rest = name.partition(".")
        if rest:
            parts.setdefault(head, {})[rest] = value
    return parts


def _within(part: Any, values: dict[str, Any], change: Callable[[Any, Mapping[str, Any]], Any]) -> Any:
    if not isinstance(part, tuple):
        return change(part, values)
    inside = _by_head(values)
    return tuple(change(each, inside[str(k)]) if str(k) in inside else each for k, each in enumerate(part))
