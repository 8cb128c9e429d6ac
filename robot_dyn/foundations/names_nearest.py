"""Objects that answer an unknown attribute by the nearest names."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

from robot_dyn.foundations.errors import nearest


class NamesNearest:
    """An object that answers an unknown attribute by the names of the nearest ones."""

    if not TYPE_CHECKING:  # so that a type checker reports unknown names

        def __getattr__(self, name: str) -> Any:
            if name.startswith("_") or hasattr(type(self), name):
                return object.__getattribute__(self, name)  # raises the error of a property, or the usual one
            raise AttributeError(_unknown(type(self), name))


@lru_cache(256)  # code that probes for an attribute does so often
def _unknown(kind: type, name: str) -> str:
    """Return the message about an unknown attribute."""
    names = {*dir(kind), *getattr(kind, "__dataclass_fields__", ())}
    public = sorted(known for known in names if not known.startswith("_"))
    return f"{kind.__name__} has no attribute {name!r}; {nearest(name, public)}"
