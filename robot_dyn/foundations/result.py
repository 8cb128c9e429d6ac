"""Results as plain data: the fields of a dataclass, and the properties declared as `reported`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from math import isfinite
from typing import TYPE_CHECKING, overload

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

UNREPORTED: Mapping[str, bool] = {"reported": False}
"""Metadata of a field that plain data omit."""


class reported(property):  # noqa: N801 - used like `property`
    """A property that plain data include, like a field."""


@overload
def plain(value: DataclassInstance | Mapping[str, object]) -> dict[str, object]: ...
@overload
def plain(value: object) -> object: ...
def plain(value: object) -> object:
    """Convert a value for JSON: non-finite numbers become None, complex numbers pairs.

    Args:
        value: Nested dataclasses, mappings, sequences, arrays, enumerations, numbers and texts.
    """
    if is_dataclass(value):
        names = [field.name for field in fields(value) if field.metadata.get("reported", True)]
        kinds = reversed(type(value).__mro__)
        names += [name for kind in kinds for name, x in vars(kind).items() if isinstance(x, reported)]
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, tuple | list):
        return [plain(entry) for entry in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    return None if isinstance(value, float) and not isfinite(value) else value


def json_text(value: object) -> str:
    """Return the plain data of a value as JSON."""
    return json.dumps(plain(value), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
