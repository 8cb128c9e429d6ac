"""Suggestions in errors about unknown attributes."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

from robot_dyn.foundations.errors import nearest


class SuggestsNames:
    """An object whose error about an unknown attribute suggests similar public names."""

    if not TYPE_CHECKING:  # so that a type checker reports unknown names

        def __getattr__(self, name: str) -> Any:
            if name.startswith("_") or hasattr(type(self), name):
                return object.__getattribute__(self, name)  # raises the property's own error, or the usual one
            raise AttributeError(_unknown(type(self), name))


@lru_cache(256)  # some libraries probe for the same attribute again and again
def _unknown(kind: type, name: str) -> str:
    """Return the message about an unknown attribute."""
    names = {*dir(kind), *getattr(kind, "__dataclass_fields__", ())}
    public = sorted(known for known in names if not known.startswith("_"))
    return f"{kind.__name__} has no attribute {name!r}; {nearest(name, public)}"
