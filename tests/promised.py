"""A document of `--json` has exactly the keys of docs/reference/json.md, in every part of it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from json_reference import document, keys, nested


def check_document(command: str, found: Any, without: Iterable[str] = ()) -> None:
    """Compare the keys of a document, and of all entries that have keys, with the reference.

    Args:
        command: First word of the command.
        found: The document.
        without: Keys that this document does not have.
    """
    promised = document(command).keys
    assert found.keys() == promised.keys() - set(without)
    waiting = [(path, kind, found) for path, kind in nested(promised)]
    while waiting:
        path, kind, value = waiting.pop()
        for entry in entries(value, path.replace("[]", ".[]").split(".")):
            inner = keys(kind)
            assert entry.keys() == inner.keys(), path
            if kind is not document(command).kind:  # a document inside itself has the same keys
                waiting += [(below, other, entry) for below, other in nested(inner)]


def entries(value: Any, path: list[str]) -> list[Any]:
    """Return the objects at a path such as `quantities.*`; absent and null ones are left out."""
    values = [value]
    for part in path:
        if part == "[]":
            values = [x for entry in values for x in entry]
        elif part == "*":
            values = [x for entry in values for x in entry.values()]
        else:
            values = [entry[part] for entry in values if entry.get(part) is not None]
    return values
