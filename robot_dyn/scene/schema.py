"""What every part of a scene obeys: no unknown key, finite numbers, units in the names of the keys."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from robot_dyn.errors import RobotDynError
from robot_dyn.model.edits import by_joint
from robot_dyn.model.robot import Robot


class SceneError(RobotDynError):
    """A scene that cannot be read; names file, key path and value."""


class Part(BaseModel):
    """A table of a scene."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True, strict=False)


Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Vector3 = tuple[float, float, float]
PerJoint = float | list[float] | dict[str, float]  # for all joints, for each, or by name (0 elsewhere)
Stated = PerJoint | Literal["urdf"]


def per_joint(
    what: str, value: Any, robot: Robot, urdf: np.ndarray | None = None, elsewhere: float = 0.0
) -> np.ndarray:
    """The (n,) array of a value for all joints, for each, by name, or as the file states."""
    if isinstance(value, str) and urdf is not None:
        return urdf
    values = by_joint(what, value, robot.joint_names)
    return np.array([values.get(name, elsewhere) for name in robot.joint_names])
