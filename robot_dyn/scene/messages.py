"""Error messages of scenes: the line, the key, what it must be, its value, and the valid keys."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from reprlib import repr as bounded_repr
from typing import Any, get_args

from pydantic import ValidationError

from robot_dyn.foundations.errors import nearest, shorten
from robot_dyn.scene.lines import line_of
from robot_dyn.scene.schema import Part, kinds_of
from robot_dyn.scene.tool_tables import tool_tables

# Branches of a value that may be written in several ways, by pydantic's names.
_WAYS = {
    "float": "a number",
    "list[float]": "a list of numbers",
    "dict[str,float]": "a table of numbers by joint",
    "literal['urdf']": "'urdf'",
}
_MUST = {
    "float": "must be a number",
    "int": "must be an integer",
    "bool": "must be true or false",
    "string": "must be a text",
    "finite": "must be a finite number",
    "list": "must be a list",
    "tuple": "must be a list",
    "dict": "must be a table",
    "model": "must be a table",
    "greater_than_equal": "must not be negative",
    "greater_than": "must be positive",
}


def shown(value: Any) -> str:
    """A value of a scene, shortened if it is long or deeply nested."""
    return shorten(bounded_repr(value))


def where(table: Any, path: Sequence[str | int]) -> str:
    """A path as text: `effect 2 (spring): rest_rad`."""
    names: list[str] = []
    value: Any = table
    for part in path:
        value = value[part] if _has(value, part) else None
        if isinstance(part, int) and names:
            names[-1] += f"{',' if names[-1][-1].isdigit() else ''} {part + 1}"
        else:
            names.append(shorten(part))
        if isinstance(part, int) and isinstance(value, dict) and isinstance(value.get("kind"), str):
            names[-1] += f" ({shorten(value['kind'])})"
    return ": ".join(names)


def located(text: str, path: Sequence[str | int], message: str) -> str:
    """Return the message, preceded by the line at which a path is stated."""
    line = line_of(text, path)
    return message if line is None else f"line {line}: {message}"


def validation_message(error: ValidationError, table: Mapping[str, Any], text: str, schema: type[Part]) -> str:
    """Return the first error in the table of a scene, and the number of the others.

    Args:
        error: As pydantic raised it.
        table: The table that was checked.
        text: Its TOML text.
        schema: The schema of the table.
    """
    found = error.errors(include_url=False)
    first = next((each for each in found if each["type"] == "extra_forbidden"), found[0])
    path = _path(table, first)
    if first["loc"][-1] in _WAYS or len(path) < len(
        first["loc"]
    ):  # of the ways to write a value, the one that got furthest
        below = [each for each in found if _path(table, each)[: len(path)] == path]
        first = max(below, key=lambda each: len(_path(table, each)))
        path = _path(table, first)
    same = {_path(table, each) for each in found} - {path}
    more = f" (and {len(same)} more)" if same else ""
    return located(text, path, _message(first, found, path, table, schema) + more)


def _message(first: Any, found: list[Any], path: tuple[str | int, ...], table: Any, schema: type[Part]) -> str:
    kind, context, at = first["type"], first.get("ctx", {}), where(table, path)
    got = f"got {shown(first.get('input'))}"
    if kind == "extra_forbidden":
        keys = [*_section(table, path[:-1], schema).model_fields, *(() if path[:-1] else tool_tables())]
        section = where(table, path[:-1]) or "a scene"
        key, close = str(path[-1]), nearest(str(path[-1]), keys)
        others = f"; keys: {', '.join(keys)}" if close.startswith("nearest") else ""
        return f"{shorten(key)!r} is not a key of {section}; {close}{others}"
    if kind == "missing" and isinstance(path[-1], int):
        return f"{where(table, path[:-1])}: must have 3 entries, got {path[-1]}"
    if kind == "missing":
        return f"{at}: is missing; give it"
    if kind == "union_tag_not_found":
        return f"{at}: has no kind; give one of {_known_kinds(table, path, schema)}"
    if kind == "union_tag_invalid":
        tags = [tag.strip(" '") for tag in context["expected_tags"].split(",")]
        return f"{at}: kind: no kind {shorten(context['tag'])!r}; {nearest(context['tag'], tags)}"
    if kind == "literal_error" and not any(part in _WAYS for part in first["loc"]):
        return f"{at}: must be {context['expected']}, {got}"
    if kind == "too_long":
        return f"{at}: must have {context['max_length']} entries, got {context['actual_length']}"
    ways = [_WAYS[str(each["loc"][-1])] for each in found if _path(table, each) == path and each["loc"][-1] in _WAYS]
    if len(ways) > 1:
        return f"{at}: must be {', '.join(ways[:-1])} or {ways[-1]}, {got}"
    must = next((text for start, text in _MUST.items() if kind.startswith(start)), "is not an allowed value")
    return f"{at}: {must}, {got}"


def _known_kinds(table: Any, path: Sequence[str | int], schema: type[Part]) -> str:
    """The kinds that the part at a path may have."""
    key = next(key for key in reversed(path) if isinstance(key, str))
    owner = _section(table, path[: path.index(key)], schema)
    return ", ".join(str(kind) for part in _parts(owner.model_fields[key].annotation) for kind in kinds_of(part))


def _path(table: Any, error: Any) -> tuple[str | int, ...]:
    """The path of an error in the table, without the branches that pydantic adds."""
    path: list[str | int] = []
    value: Any = table
    for k, part in enumerate(error["loc"]):
        last = k == len(error["loc"]) - 1
        if _has(value, part):
            value = value[part]
            path.append(part)
        elif last and error["type"] == "missing":
            path.append(part)
    return tuple(path)


def _has(value: Any, part: str | int) -> bool:
    if isinstance(value, list | tuple):
        return isinstance(part, int) and part < len(value)
    return isinstance(value, dict) and part in value


def _section(table: Any, path: Sequence[str | int], schema: type[Part]) -> type[Part]:
    """The part of the schema that a path leads to."""
    part, choice = schema, [schema]
    value: Any = table
    for key in path:
        value = value[key]
        if isinstance(key, str) and key in part.model_fields:
            choice = _parts(part.model_fields[key].annotation)
        kind = value.get("kind") if isinstance(value, dict) else None
        part = next((each for each in choice if kind in kinds_of(each)), choice[0] if choice else part)
    return part


def _parts(annotation: Any) -> list[type[Part]]:
    """The parts that an annotation names."""
    if isinstance(annotation, type) and issubclass(annotation, Part):
        return [annotation]
    return [part for each in get_args(annotation) for part in _parts(each)]
