"""Effects of a user's own in a scene: kinds that the caller names, each with the class or function that makes one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from inspect import signature
from typing import Any

from pydantic import ValidationInfo, ValidatorFunctionWrapHandler

from robot_dyn.coefficients import Coefficient
from robot_dyn.effects.effect import Effect
from robot_dyn.errors import SceneError, shown
from robot_dyn.model.robot import Robot
from robot_dyn.scene.declared import keys_of
from robot_dyn.scene.schema import Part, per_joint
from robot_dyn.validate import number, numbers

Makers = Mapping[str, Callable[..., Effect]]


class OwnEffect(Part):
    """An effect of a kind that the caller named; its keys are the arguments of what makes it."""

    kind: str
    values: dict[str, Any]
    """The other keys."""
    make: Any
    """The class or function."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        """The effect; SceneError if its keys are others than the arguments."""
        known = signature(self.make)
        of = keys_of(self.make, self.make) if isinstance(self.make, type) else {}
        given = {of[key][0] if key in of else key: (key, value) for key, value in self.values.items()}
        arguments = {name: _argument(key, value, robot, of.get(key)) for name, (key, value) in given.items()}
        try:
            known.bind(**arguments)
        except TypeError as error:
            spelled = {name: key for key, (name, _) in of.items()}
            keys = ", ".join(spelled.get(name, name) for name in known.parameters)
            raise SceneError(f"{self.kind}: {error}; keys: {keys}") from None
        return (self.make(**arguments),)


def own_or(value: Any, otherwise: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
    """The table of an effect of the caller's kinds, which stand in the context; or of another."""
    makers: Makers = info.context or {}
    kind = value.get("kind") if isinstance(value, dict) else None
    if isinstance(kind, str) and kind in makers:
        rest = {key: each for key, each in value.items() if key != "kind"}
        return OwnEffect(kind=kind, values=rest, make=makers[kind])
    return otherwise(value)


def check_makers(effects: Any, taken: set[str]) -> Makers:
    """What makes effects, by kind; SceneError if it is nothing that does, or a kind of scenes has its name."""
    if not isinstance(effects, Mapping) or not all(
        isinstance(kind, str) and callable(effects[kind]) for kind in effects
    ):
        raise SceneError(f"effects: give classes of effects by kind, as {{'stribeck': Stribeck}}, got {shown(effects)}")
    if both := taken & effects.keys():
        raise SceneError(f"effects: {min(both)!r} is a kind that scenes have; take another name")
    return effects


def _argument(key: str, value: Any, robot: Robot, known: tuple[str, Coefficient] | None) -> Any:
    """A number, an array of a list, an array (n,) of a table by joint; a text or truth value as it is."""
    if known is not None and known[1].of_joints:
        return per_joint(key, value, robot, elsewhere=known[1].elsewhere)
    if isinstance(value, dict):
        return per_joint(key, value, robot)
    if isinstance(value, list):
        return numbers(key, value, ("k",), ("k", "m"), error=SceneError)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return number(key, value, error=SceneError)
    return value
