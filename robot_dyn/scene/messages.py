"""Error messages of scenes: the errors of pydantic, with the line, the key and the value."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from reprlib import repr as bounded_repr
from typing import Any

from pydantic import ValidationError

from robot_dyn.foundations.errors import shorten

_WORDS = {"Input should be": "must be", "Field required": "is missing; give it", "valid tuple": "list"}


def validation_message(error: ValidationError, table: Mapping[str, Any], text: str) -> str:
    """Return the first error in the table of a scene, and the number of the others.

    Args:
        error: As pydantic raised it.
        table: The table that was checked.
        text: Its TOML text.
    """
    first, *others = error.errors(include_url=False)
    kind, context, path = first["type"], first.get("ctx", {}), first["loc"]
    message = str(context["error"]) if kind == "value_error" else first["msg"]
    for pydantics, words in _WORDS.items():
        message = message.replace(pydantics, words)
    if kind not in ("missing", "wrong_key", "value_error"):
        message += f", got {shorten(bounded_repr(first['input']))}"
    key = path[-1] if kind == "missing" else context.get("key")
    place = ".".join([*_place(table, path), *([] if key is None else [shorten(key)])])
    more = f" (and {len(others)} more)" if others else ""
    return _line(text, path or (key,)) + (f"{place}: " if place else "") + message + more


def _line(text: str, path: Sequence[Any]) -> str:
    """Return "line 3: " for a key or table at the top of a scene, "" if it is not found; `path` begins with it."""
    key, index = re.escape(str(path[0])), path[1] if len(path) > 1 and isinstance(path[1], int) else 0
    for pattern in (rf"^[ \t]*\[+[ \t]*{key}[ \t]*\]", rf"^[ \t]*{key}[ \t]*="):
        starts = [match.start() for match in re.finditer(pattern, text, re.MULTILINE)]
        if starts:
            return f"line {text.count(chr(10), 0, starts[min(index, len(starts) - 1)]) + 1}: "
    return ""


def _place(table: Any, path: Sequence[str | int]) -> list[str]:
    """Return the parts of a path as text, such as `effect 2 (spring)`, without the branches that pydantic adds."""
    names: list[str] = []
    value = table
    for part in path:
        try:
            value = value[part]
        except (LookupError, TypeError):
            continue
        if isinstance(part, str):
            names.append(shorten(part))
        else:
            names[-1] += f"{',' if names[-1][-1].isdigit() else ''} {part + 1}"
            if isinstance(value, dict) and isinstance(value.get("kind"), str):
                names[-1] += f" ({shorten(value['kind'])})"
    return names
