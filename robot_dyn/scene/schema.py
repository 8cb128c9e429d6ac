"""Rules for every part of a scene: no unknown key, finite numbers, units in the names of the keys."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from robot_dyn.description.edits import by_joint
from robot_dyn.foundations.coefficients import URDF
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.model.robot import Robot


class PlacedError(RobotDynError):
    """An error of a part of a scene, at the `path` of its keys."""

    def __init__(self, message: str, path: tuple[str | int, ...]) -> None:
        super().__init__(message)
        self.path = path


@contextmanager
def placed(*path: str | int) -> Iterator[None]:
    """Errors raised inside carry the path of a scene."""
    try:
        yield
    except RobotDynError as error:
        raise PlacedError(str(error), path) from None


class Part(BaseModel):
    """A table of a scene."""

    model_config = ConfigDict(
        extra="forbid", allow_inf_nan=False, frozen=True, strict=False, use_attribute_docstrings=True
    )


def kinds_of(part: type[Part]) -> tuple[str, ...]:
    """The values that the key `kind` of a part may have."""
    return get_args(part.model_fields["kind"].annotation) if "kind" in part.model_fields else ()


# Strict: a text or a truth value is not a number.
Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Positive = Annotated[float, Field(gt=0, strict=True)]
NotNegative = Annotated[float, Field(ge=0, strict=True)]
Truth = Annotated[bool, Field(strict=True)]
Vector3 = tuple[Number, Number, Number]
PerJoint = Number | list[Number] | dict[str, Number]  # for all joints, for each, or by name (0 elsewhere)
Stated = PerJoint | Literal["urdf"]


def urdf_or(value: Any, handler: Callable[[Any], Any]) -> Any:
    """The text "urdf" as it is; anything else as the key has it, with its messages."""
    return URDF if value == URDF else handler(value)


def per_joint(what: str, value: Any, robot: Robot, elsewhere: float = 0.0) -> Any:
    """The (n,) array of a value for all joints, for each, or by name; the effect resolves "urdf" itself."""
    if value == URDF:
        return URDF
    values = by_joint(what, value, robot.joint_names)
    return np.array([values.get(name, elsewhere) for name in robot.joint_names])
