"""Error messages of scenes: line numbers of top-level keys and tables, and errors of pydantic with key and value."""

from __future__ import annotations

import re
from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import contextmanager
from reprlib import repr as bounded_repr
from typing import Any

from pydantic import ValidationError

from robot_dyn.foundations.errors import RobotDynError, SceneError, shorten

_WORDS = {
    "Input should be": "must be", "Field required": "is missing; give it", "valid tuple": "list", "valid list": "list",
    "valid dictionary": "table", "a valid string": "text", "a valid boolean": "true or false", "valid number": "number",
    "a valid integer": "an integer", "greater than or equal to": "at least",
}  # fmt: skip
_TABLE = re.compile(r"^[ \t]*\[+[ \t]*[A-Za-z_\"']", re.MULTILINE)  # the header of a table


@contextmanager
def part(*path: str | int) -> Iterator[None]:
    """Add the path of the part that is built, such as ("effect", 1), to errors; the path of an inner part is kept."""
    try:
        yield
    except RobotDynError as error:
        vars(error).setdefault("part", path)
        raise


@contextmanager
def named_by_key(keys: Mapping[str, str]) -> Iterator[None]:
    """Name the keys of the file in errors, such as "half_gap_rad", instead of the arguments, such as "half_gap".

    Args:
        keys: Keys by the name of the argument in messages.

    Raises:
        SceneError: Instead of an error whose message names an argument.
    """
    try:
        yield
    except RobotDynError as error:
        renamed = {name: key for name, key in keys.items() if name != key}
        if not renamed:
            raise
        names = "|".join(map(re.escape, sorted(renamed, key=len, reverse=True)))
        before, after = "than |without |as ", "= | must| of '| names no| has no| has values| is 0|:"
        message = re.sub(
            rf"(?<![\w.])({names})='(\w+)'", lambda match: f'{renamed[match[1]]} = "{match[2]}"', str(error)
        )
        for pattern in (
            *(rf"(?<={word})({names})\b" for word in before.split("|")),
            rf"(?<![\w.])({names})(?={after})",
        ):
            message = re.sub(pattern, lambda match: renamed[match[1]], message)
        if message == str(error):
            raise
        named = SceneError(message)
        vars(named).update(vars(error))
        raise named from None


@contextmanager
def named_part(paths: Mapping[str, tuple[str | int, ...]], kinds: Sequence[str]) -> Iterator[None]:
    """Find the first part named in the message of an error; add its path to the error and its place to the message.

    Args:
        paths: Paths by the words that stand for them in messages, such as "step_s" or "coulomb_friction".
        kinds: Kinds of the effects of the scene.

    Raises:
        SceneError: Instead of an error whose message names a part.
    """
    try:
        yield
    except RobotDynError as error:
        path = next((paths[word] for word in re.findall(r"\w+", str(error)) if word in paths), ())
        if not path:
            raise
        start, place = str(path[0]), str(path[0])
        if len(path) > 1:
            start = kinds[int(path[1])]
            place = f"effect {int(path[1]) + 1} ({start})"
        message = re.sub("method='(.+?)'", r'method = "\1"', str(error).removeprefix(f"{start}: "))
        named = SceneError(f"{place}: {message}")
        vars(named)["part"] = path
        raise named from None


def validation_message(error: ValidationError, table: Mapping[str, Any], text: str) -> str:
    """Return a message about the first error in the table of a scene, with the number of other errors.

    Args:
        error: The error of pydantic.
        table: The checked table.
        text: TOML text of the table.
    """
    first, *others = error.errors(include_url=False)
    kind, context, path = first["type"], first.get("ctx", {}), first["loc"]
    message = str(context["error"]) if kind == "value_error" else first["msg"]
    if kind not in ("wrong_key", "value_error"):  # a message of pydantic
        for original, words in _WORDS.items():
            message = message.replace(original, words)
        message = re.sub("greater than 0$", "positive", message)
        if kind != "missing":
            message += f", got {shorten(bounded_repr(first['input']))}"
        if kind == "string_type" and len(path) == 1 and isinstance(first["input"], dict):
            message += f'; write {path[0]} = "…" before the first table'
    key = path[-1] if kind == "missing" else context.get("key")
    place = ".".join([*_place(table, path), *([] if key is None else [shorten(key)])])
    more = f" (and {len(others)} more)" if others else ""
    top = path or (str(key) if key in table else str(key).partition(".")[0],)
    return line(text, table, top) + (f"{place}: " if place else "") + message + more


def line(text: str, keys: Container[object], path: Sequence[str | int]) -> str:
    """Return "line 3: " for the top-level key or table of a scene at which a path begins; "" if there is none.

    Args:
        text: The TOML text.
        keys: The top-level keys.
        path: Keys and indices from 0; ("effect", 1) is the second table of [[effect]].
    """
    if not path or path[0] not in keys:
        return ""
    key, index = rf"[\"']?{re.escape(str(path[0]))}[\"']?", path[1] if len(path) > 1 and isinstance(path[1], int) else 0
    first_table = _TABLE.search(text)
    top = text if first_table is None else text[: first_table.start()]
    for pattern, where in ((rf"\[+[ \t]*{key}[ \t]*\]", text), (rf"{key}[ \t]*[=.]", top)):
        if starts := [match.start() for match in re.finditer(rf"^\ufeff?[ \t]*{pattern}", where, re.MULTILINE)]:
            return f"line {text.count(chr(10), 0, starts[min(index, len(starts) - 1)]) + 1}: "
    return ""


def _place(table: Any, path: Sequence[str | int]) -> list[str]:
    """Return the parts of a path as text, such as `effect 2 (spring)`, without the branches added by pydantic."""
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
