"""Sentences built from parts and facts, so that results are stored as numbers and names and worded in one table."""

from __future__ import annotations

from collections.abc import Mapping
from string import Formatter

Facts = Mapping[str, float | str]
"""Numbers and names by name: the fields of a sentence."""

Part = str | tuple[str, ...]
"""A format string; or several, from which the first with all its facts known is used."""

Parts = tuple[Part, ...]
"""The parts of a sentence."""


def sentence(parts: Parts, facts: Facts) -> str:
    """Return the parts of a sentence with their facts filled in, without the parts whose facts are missing."""
    return "".join(text.format_map(facts) for text in _chosen(parts, facts))


def stated(parts: Parts, facts: Facts) -> dict[str, float | str]:
    """Return the facts that the sentence contains."""
    names = {name for text in _chosen(parts, facts) for name in _fields(text)}
    return {name: value for name, value in facts.items() if name in names}


def prefixed(prefix: str, part: Part) -> Part:
    """Return a part with a prefix before each of its format strings."""
    return tuple(prefix + text for text in _texts(part))


def _chosen(parts: Parts, facts: Facts) -> list[str]:
    """Return the format string of each part whose facts are known."""
    return [next((text for text in _texts(part) if _fields(text) <= facts.keys()), "") for part in parts]


def _texts(part: Part) -> tuple[str, ...]:
    return (part,) if isinstance(part, str) else part


def _fields(text: str) -> set[str]:
    """Return the names of the facts in a format string."""
    return {name for _, name, _, _ in Formatter().parse(text) if name}
