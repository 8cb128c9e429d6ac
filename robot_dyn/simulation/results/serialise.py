"""Serialisation of values: a dataclass as named arrays and plain data (JSON), and back, by the types of its fields.

An array's name is the path of its field, such as `ledger/kinetic` or `power/control`, and its type and shape are those
of the field's `Layout`; all else is plain. A field whose metadata are `NOT_STORED` is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from robot_dyn.foundations.errors import RobotDynError, shorten
from robot_dyn.foundations.values import Layout
from robot_dyn.simulation.results.archive import ArchiveError, Header

Arrays = dict[str, np.ndarray]
_ABSENT: Any = object()  # in the plain data; None is a value


class SerialError(RobotDynError):
    """Data that is not that of a value."""


def layouts(kind: Any, path: str = "") -> dict[str, Layout]:
    """The arrays of a type by path; `/*` stands for one array under each name."""
    if get_origin(kind) is Annotated:
        return {path: kind.__metadata__[0]}
    if get_origin(kind) in (Union, UnionType):
        return {name: layout for each in get_args(kind) for name, layout in layouts(each, path).items()}
    parts = _field_types(kind) if is_dataclass(kind) else {"*": get_args(kind)[1]} if get_origin(kind) is dict else {}
    return {name: layout for key, each in parts.items() for name, layout in layouts(each, _join(path, key)).items()}


def layout_of(name: str, known: Mapping[str, Layout]) -> Layout:
    """The layout of an array; ArchiveError if it is not known."""
    groups = [path for path in known if path.endswith("/*") and name.startswith(path[:-1])]
    for path in (name, *groups):
        if path in known:
            return known[path]
    raise ArchiveError(f"member {shorten(name)!r} is not known to this version")


def check_headers(kind: Any, headers: Mapping[str, Header], plain: Mapping[str, Any]) -> None:
    """Raise an ArchiveError unless all arrays have their layouts, where a letter stands for one length.

    Args:
        kind: Type of the value; n is the length of its `joint_names`.
        headers: Of its arrays, by path.
        plain: Its plain data.
    """
    known, joint_names = layouts(kind), plain.get("joint_names")
    lengths: dict[Any, int] = {"n": len(joint_names) if isinstance(joint_names, list) else 0}
    for name, header in headers.items():
        layout = layout_of(name, known)
        fits = len(header.shape) == len(layout.shape) and header.dtype == layout.dtype
        if not fits or not all(_fits(*pair, lengths) for pair in zip(header.shape, layout.shape, strict=True)):
            shape = ", ".join(f"{each} = {lengths[each]}" if each in lengths else str(each) for each in layout.shape)
            raise ArchiveError(f"member {shorten(name)!r} holds {header}, not {layout.dtype} ({shape})")


def _fits(length: int, allowed: Any, lengths: dict[Any, int]) -> bool:
    if isinstance(allowed, tuple):
        return any(_fits(length, each, lengths) for each in allowed)
    if isinstance(allowed, str):
        return lengths.setdefault(allowed, length) == length
    return allowed in (None, length)


def _field_types(kind: Any) -> dict[str, Any]:
    """Types of the fields that are stored, by name."""
    types = get_type_hints(kind, include_extras=True)
    return {each.name: types[each.name] for each in fields(kind) if each.metadata.get("stored", True)}


def take_apart(value: Any, path: str = "") -> tuple[Arrays, Any]:
    """The arrays of a value by path, and the rest as plain data."""
    if isinstance(value, np.ndarray):
        return {path: value}, None
    if isinstance(value, Mapping) or (is_dataclass(value) and not isinstance(value, type)):
        names = value if isinstance(value, Mapping) else _field_types(type(value))
        items = {key: value[key] if isinstance(value, Mapping) else getattr(value, key) for key in names}
        parts = {key: (take_apart(part, _join(path, key)), part) for key, part in items.items()}
        arrays = {name: array for (below, _), _ in parts.values() for name, array in below.items()}
        return arrays, {key: plain for key, ((_, plain), part) in parts.items() if not isinstance(part, np.ndarray)}
    if isinstance(value, tuple | list):
        parts = [take_apart(part, _join(path, k)) for k, part in enumerate(value)]
        return {name: array for below, _ in parts for name, array in below.items()}, [plain for _, plain in parts]
    return {}, value.item() if isinstance(value, np.generic) else value


def build(kind: Any, plain: Any, arrays: Arrays, path: str = "") -> Any:
    """The value of type `kind` that was taken apart into these; takes its arrays out of `arrays`.

    Raises:
        SerialError: If something is missing, left over or of another type; names its path.
    """
    origin, inside = get_origin(kind), get_args(kind)
    if origin is Annotated:
        if path not in arrays:
            raise SerialError(f"member {path!r} is missing")
        return arrays.pop(path)
    if origin in (Union, UnionType) and NoneType in inside:
        (rest,) = (each for each in inside if each is not NoneType)
        absent = path not in arrays if get_origin(rest) is Annotated else plain in (None, _ABSENT)
        return None if absent else build(rest, plain, arrays, path)
    if is_dataclass(kind):
        return _dataclass(kind, plain, arrays, path)
    if origin is dict:
        return _dict(inside[1], plain, arrays, path)
    if origin is tuple and isinstance(plain, list) and (inside[-1] is ... or len(inside) == len(plain)):
        kinds = [inside[0]] * len(plain) if inside[-1] is ... else inside
        return tuple(build(k, x, arrays, _join(path, i)) for i, (k, x) in enumerate(zip(kinds, plain, strict=True)))
    return _scalar(kind, plain, path)


def _dataclass(kind: Any, plain: Any, arrays: Arrays, path: str) -> Any:
    if not isinstance(plain, dict):
        raise _wrong(path, plain, "a table")
    types, values = _field_types(kind), {}
    if unknown := plain.keys() - types.keys():
        raise SerialError(f"{_join(path, min(unknown))!r} is not known to this version")
    for field in fields(kind):
        if field.name not in types:
            continue
        below = _join(path, field.name)
        optional = field.default is not MISSING or field.default_factory is not MISSING
        if optional and field.name not in plain and not any(f"{name}/".startswith(f"{below}/") for name in arrays):
            continue
        values[field.name] = build(types[field.name], plain.get(field.name, _ABSENT), arrays, below)
    return kind(**values)


def _dict(kind: Any, plain: Any, arrays: Arrays, path: str) -> dict[str, Any]:
    of_arrays = get_origin(kind) is Annotated
    if of_arrays and plain in ({}, _ABSENT):
        names = [name for name in arrays if name.startswith(f"{path}/")]
        return {name.removeprefix(f"{path}/"): arrays.pop(name) for name in names}
    if of_arrays or not isinstance(plain, dict):
        raise _wrong(path, plain, "a table")
    return {_scalar(str, key, path): build(kind, value, arrays, _join(path, key)) for key, value in plain.items()}


def _scalar(kind: Any, plain: Any, path: str) -> Any:
    """A text, number, truth value or member of an enumeration."""
    if kind is str and isinstance(plain, str):
        if not plain.isascii() and any("\ud800" <= letter <= "\udfff" for letter in plain):
            raise SerialError(f"{path!r} holds half a character (a surrogate)")
        return plain
    if (kind is bool and isinstance(plain, bool)) or (kind is int and type(plain) is int):
        return plain
    if kind is float and type(plain) in (int, float):
        with suppress(OverflowError):
            return float(plain)
    if isinstance(kind, type) and issubclass(kind, Enum):
        values = {each.value: each for each in kind}
        if isinstance(plain, str) and plain in values:
            return values[plain]
        raise _wrong(path, plain, " or ".join(values))
    raise _wrong(path, plain, getattr(kind, "__name__", str(kind)))


def _wrong(path: str, plain: Any, kind: str) -> SerialError:
    if plain is _ABSENT:
        return SerialError(f"{path!r} is missing")
    return SerialError(f"{path or 'the whole'!r} holds {shorten(repr(plain))}, not {kind}")


def _join(path: str, name: object) -> str:
    return f"{path}/{name}" if path else str(name)
