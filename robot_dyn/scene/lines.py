"""Line numbers of the keys of a TOML text, for messages; tomllib does not report them."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from typing import Any

Path = tuple[str | int, ...]
_MOST = 200  # lines of one statement; after a longer one, line numbers are unknown


def line_of(text: str, path: Sequence[str | int]) -> int | None:
    """Return the line, from 1, at which a key is stated, otherwise that of its table; None if unknown."""
    lines = _lines(text)
    return next((lines[tuple(path[:k])] for k in range(len(path), 0, -1) if tuple(path[:k]) in lines), None)


def _lines(text: str) -> dict[Path, int]:
    """Return the first line of each path. A statement is the least number of lines that is valid TOML alone."""
    found: dict[Path, int] = {}
    section: Path = ()
    last: dict[Path, int] = {}  # index of the last table of each array of tables
    statement: list[str] = []
    for number, line in enumerate(text.split("\n"), 1):
        statement.append(line)
        try:
            table = tomllib.loads("\n".join(statement))
        except (ValueError, RecursionError):
            if len(statement) > _MOST:
                break
            continue
        keys, start, first = _keys(table), number - len(statement) + 1, statement[0].lstrip()
        statement = []
        if first.startswith("["):
            path: Path = ()
            for key in keys:
                path += (key,)
                if first.startswith("[[") and len(path) - sum(isinstance(each, int) for each in path) == len(keys):
                    last[path] = last.get(path, -1) + 1
                path += (last[path],) if path in last else ()
            section = path
        path = section if first.startswith("[") else section + keys
        for k in range(1, len(path) + 1):
            found.setdefault(path[:k], start)
    return found


def _keys(value: Any) -> tuple[str, ...]:
    """The keys of tables that hold one entry each, from the outside in."""
    keys: tuple[str, ...] = ()
    while isinstance(value, dict) and len(value) == 1:
        ((key, value),) = value.items()
        keys += (key,)
    return keys
