"""A placeholder for the time in a query without t: an effect that uses it raises an error with its name."""

from __future__ import annotations

from typing import Any, final

from robot_dyn.foundations.errors import MissingTimeError


@final
class _MissingTime:
    """A placeholder for a number: every operation raises a MissingTimeError, but it may be passed as an argument."""

    __hash__ = object.__hash__


def _refuse(*_: Any, **__: Any) -> Any:
    raise MissingTimeError("an effect depends on the time: pass t=, in [s]")


_OF_NUMBERS = {name for name in dir(float) if name.startswith("__")} - set(dir(object))
_OF_ALL = {f"__{name}__" for name in ("eq", "ne", "lt", "le", "gt", "ge", "complex", "index", "len", "iter")}
_OF_ARRAYS = {"__array__", "__array_ufunc__", "__array_function__"}
for _name in _OF_NUMBERS | _OF_ALL | _OF_ARRAYS:
    setattr(_MissingTime, _name, _refuse)

MISSING_TIME: Any = _MissingTime()
