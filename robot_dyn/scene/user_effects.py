"""User-defined effects in a scene: the caller names their kinds, each with its class or factory function."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from inspect import signature
from typing import Any

from pydantic import ValidationInfo, ValidatorFunctionWrapHandler

from robot_dyn.effects.effect import Effect
from robot_dyn.foundations.coefficients import Coefficient
from robot_dyn.foundations.errors import SceneError, shown
from robot_dyn.foundations.validate import number, numbers
from robot_dyn.model.robot import Robot
from robot_dyn.scene.declared import keys_of
from robot_dyn.scene.schema import Part, per_joint

Factories = Mapping[str, Callable[..., Effect]]


class UserEffect(Part):
    """An effect of a user-defined kind; its keys are the arguments of its factory."""

    kind: str
    values: dict[str, Any]
    """The other keys."""
    factory: Any
    """The class or function."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        """Return the effect; SceneError if its keys are not the arguments."""
        known = signature(self.factory)
        of = keys_of(self.factory, self.factory) if isinstance(self.factory, type) else {}
        given = {of[key][0] if key in of else key: (key, value) for key, value in self.values.items()}
        arguments = {name: _argument(key, value, robot, of.get(key)) for name, (key, value) in given.items()}
        try:
            known.bind(**arguments)
        except TypeError as error:
            spelled = {name: key for key, (name, _) in of.items()}
            keys = ", ".join(spelled.get(name, name) for name in known.parameters)
            raise SceneError(f"{self.kind}: {error}; keys: {keys}") from None
        return (self.factory(**arguments),)


def user_defined_or(value: Any, otherwise: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
    """Validate the table of an effect, of a user-defined kind (these stand in the context) or of another."""
    factories: Factories = info.context or {}
    kind = value.get("kind") if isinstance(value, dict) else None
    if isinstance(kind, str) and kind in factories:
        rest = {key: each for key, each in value.items() if key != "kind"}
        return UserEffect(kind=kind, values=rest, factory=factories[kind])
    return otherwise(value)


def check_factories(effects: Any, taken: set[str]) -> Factories:
    """Return the factories by kind; SceneError if one is not callable, or is named as a built-in kind."""
    if not isinstance(effects, Mapping) or not all(
        isinstance(kind, str) and callable(effects[kind]) for kind in effects
    ):
        raise SceneError(f"effects: give classes of effects by kind, as {{'stribeck': Stribeck}}, got {shown(effects)}")
    if both := taken & effects.keys():
        raise SceneError(f"effects: {min(both)!r} is a kind that scenes have; take another name")
    return effects


def _argument(key: str, value: Any, robot: Robot, known: tuple[str, Coefficient] | None) -> Any:
    """Return a number, an array for a list, an array (n,) for a table by joint; texts and truth values as they are."""
    if known is not None and known[1].of_joints:
        return per_joint(key, value, robot, elsewhere=known[1].elsewhere)
    if isinstance(value, dict):
        return per_joint(key, value, robot)
    if isinstance(value, list):
        return numbers(key, value, ("k",), ("k", "m"), error=SceneError)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return number(key, value, error=SceneError)
    return value
