"""Rules for all tables of a scene: no unknown keys, finite numbers, units in the names of keys."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union, get_args

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, GetCoreSchemaHandler, model_validator
from pydantic_core import PydanticCustomError, core_schema

from robot_dyn.description.edits import by_joint
from robot_dyn.foundations.coefficients import URDF, URDF_SOFT
from robot_dyn.foundations.errors import nearest, shorten
from robot_dyn.model.robot import Robot


class Part(BaseModel):
    """A table of a scene."""

    model_config = ConfigDict(
        extra="forbid", allow_inf_nan=False, frozen=True, strict=False, use_attribute_docstrings=True
    )

    @classmethod
    def valid_keys(cls) -> tuple[str, ...]:
        """Return the keys that the table may have."""
        return tuple(field.alias or name for name, field in cls.model_fields.items())

    @model_validator(mode="before")
    @classmethod
    def _table_of_valid_keys(cls, value: Any) -> Any:
        valid = cls.valid_keys()
        for key in _table(value):
            if key not in valid and cls.model_config.get("extra") != "allow":
                raise wrong_key(key, f"unknown key; {nearest(key, valid)}")
        return value


def _table(value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise PydanticCustomError("form", "must be a table")
    return value


def wrong_key(key: str, message: str) -> PydanticCustomError:
    """Return the error of a key of a table; the key may be missing."""
    return PydanticCustomError("wrong_key", "{message}", {"key": key, "message": message})


def kinds_of(part: type[Part]) -> tuple[str, ...]:
    """Return the valid values of the key `kind` of a table."""
    return get_args(part.model_fields["kind"].annotation) if "kind" in part.model_fields else ()


def one_of(*parts: type[Part]) -> Any:
    """Return the type of a table that is one of several kinds."""
    kinds = [kind for part in parts for kind in kinds_of(part)]

    def with_kind(value: Any) -> Any:
        if "kind" not in _table(value):
            raise wrong_key("kind", f"is missing; give one of {', '.join(kinds)}")
        if (kind := value["kind"]) not in kinds:
            raise wrong_key("kind", f"no kind {shorten(kind)!r}; {nearest(str(kind), kinds)}")
        return value

    return Annotated[Union[parts], Field(discriminator="kind"), BeforeValidator(with_kind)]  # noqa: UP007


@dataclass(frozen=True)
class Form:
    """The form, in words, of a value that can be written in several ways.

    Attributes:
        must_be: Text for messages.
        on_page: Text for the documentation of scenes.
    """

    must_be: str
    on_page: str

    def __get_pydantic_core_schema__(self, source: type, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.custom_error_schema(
            handler(source), custom_error_type="form", custom_error_message=f"must be {self.must_be}"
        )

    def __get_pydantic_json_schema__(self, schema: core_schema.CoreSchema, handler: object) -> dict[str, str]:
        return {"type": self.on_page}


# strict: a text or a truth value is not a number
Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Positive = Annotated[float, Field(gt=0, strict=True)]
NotNegative = Annotated[float, Field(ge=0, strict=True)]
Truth = Annotated[bool, Field(strict=True)]
Vector3 = Annotated[tuple[Number, Number, Number], Form("a list of 3 finite numbers", "list of 3 numbers")]
_BY_JOINT = "a finite number, a list of them or a table of them by joint"  # joints omitted from a table have 0
PerJoint = Annotated[Number | list[Number] | dict[str, Number], Form(_BY_JOINT, "by joint")]
Point = Annotated[
    list[Number] | dict[str, Number],
    Form("a list of finite numbers or a table of them by joint", "row of n numbers or by joint"),
]
Stated = Annotated[
    Number | list[Number] | dict[str, Number] | Literal["urdf", "urdf_soft"],
    Form(f"{_BY_JOINT}, or 'urdf'", 'by joint or `"urdf"`'),
]


def per_joint(key: str, value: Any, robot: Robot, elsewhere: float = 0.0) -> Any:
    """Return a value for all joints, for each joint, or by name, as (n,); "urdf" and "urdf_soft" are unchanged."""
    if value in (URDF, URDF_SOFT):
        return value
    values = by_joint(key, value, robot.joint_names)
    return np.array([values.get(name, elsewhere) for name in robot.joint_names])
