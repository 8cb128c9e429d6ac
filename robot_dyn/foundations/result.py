"""Results as plain data, the same for all: of a dataclass its fields, and the properties that are part of it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from math import isfinite
from typing import Any

import numpy as np

UNREPORTED: Mapping[str, bool] = {"reported": False}
"""Metadata of a field that plain data leave out."""


class reported(property):  # noqa: N801 - used as `property` is
    """A property that plain data hold as they hold the fields."""


def plain(value: Any) -> Any:
    """What JSON can hold of a value: a number that is not finite is None, a complex one a pair.

    Args:
        value: Dataclasses, mappings, sequences, arrays, enumerations, numbers and texts, in each other.
    """
    if is_dataclass(value):
        names = [each.name for each in fields(value) if each.metadata.get("reported", True)]
        kinds = reversed(type(value).__mro__)
        names += [name for kind in kinds for name, each in vars(kind).items() if isinstance(each, reported)]
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [plain(each) for each in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    return None if isinstance(value, float) and not isfinite(value) else value


def json_text(value: Any) -> str:
    """Plain data of a value as JSON."""
    return json.dumps(plain(value), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
