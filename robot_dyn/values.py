"""Values that hold arrays, read-only in copies too; values whose parts are computed when read; aligned arrays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import cached_property
from math import prod
from threading import RLock
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

LINE = 64  # bytes of a cache line and of the widest vector: one that lies across two lines is two accesses

Result = TypeVar("Result")
Late = TypeVar("Late", bound="Derived")


class Value:
    """A value whose arrays, where they are read-only, stay so through `copy.deepcopy` and `pickle`."""

    def __getstate__(self) -> Any:
        state = dict(vars(self))
        return state, tuple(name for name, x in state.items() if _arrays(x) and not _writeable(x))

    def __setstate__(self, state: Any) -> None:
        values, frozen = state
        vars(self).update(values)
        for name in frozen:
            for array in _arrays(values[name]):
                array.setflags(write=False)


class Caching:
    """An immutable value that caches what functions compute from it."""

    @cached_property
    def computed(self) -> dict[Any, Any]:
        """The cached results, by function."""
        return {}


def cached(value: Caching, compute: Callable[[Any], Result]) -> Result:
    """The result of a function of the value alone, which is called once."""
    if compute not in value.computed:
        value.computed[compute] = compute(value)
    return value.computed[compute]


class Derived(Value):
    """A frozen dataclass that may be built from a source: each field is read from it at its first use.

    A field that may be read later has no default but by a factory: a default of the class would hide it.
    """

    if not TYPE_CHECKING:  # so that a type checker reports names that are not fields

        def __getattr__(self, name: str) -> Any:
            held = vars(self)
            if name in self.__dataclass_fields__ and (stored := held.get("_source")) is not None:
                source, lock = stored
                with lock:
                    if name not in held:
                        held[name] = _frozen(getattr(source, name))
                if self.__dataclass_fields__.keys() <= held.keys():
                    held.pop("_source", None)  # nothing more is read from it
            if name not in held:  # another thread may have read it, and the last one, by now
                raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}", name=name, obj=self)
            return held[name]

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *(each.name for each in fields(self))} - {"_source"})  # pyright: ignore[reportArgumentType]

    def __getstate__(self) -> Any:
        for each in fields(self):  # pyright: ignore[reportArgumentType]
            getattr(self, each.name)
        return super().__getstate__()


def derived(of: type[Late], source: Any, **known: Any) -> Late:
    """A value whose fields are the attributes of the same names of a source, except for those that are given."""
    value = object.__new__(of)
    vars(value).update({name: _frozen(x) for name, x in known.items()}, _source=(source, RLock()))
    return value


def copied(x: Any) -> Any:
    """A copy of arrays in tuples."""
    if isinstance(x, tuple):
        copies = [copied(each) for each in x]
        return type(x)(*copies) if hasattr(x, "_fields") else tuple(copies)
    return x.copy() if isinstance(x, np.ndarray) else x


def read_only(value: Any) -> None:
    """Replace the arrays of a frozen dataclass, and of dictionaries in it, by read-only views; nothing is copied."""
    for field in fields(value):
        x = getattr(value, field.name)
        if isinstance(x, dict | np.ndarray):
            object.__setattr__(value, field.name, _frozen(x))


def _frozen(x: Any) -> Any:
    """A read-only view of an array, and of those in a dictionary; any other value itself."""
    if isinstance(x, dict):
        return {key: _frozen(entry) for key, entry in x.items()}
    if isinstance(x, np.ndarray):
        x = x.view()
        x.setflags(write=False)
    return x


def _arrays(x: Any) -> list[np.ndarray]:
    """An array, or those of a dictionary."""
    return [each for each in (x.values() if isinstance(x, dict) else (x,)) if isinstance(each, np.ndarray)]


def _writeable(x: Any) -> bool:
    return any(array.flags.writeable for array in _arrays(x))


def aligned(shape: tuple[int, ...], dtype: Any = float) -> np.ndarray:
    """An array of zeros in row-major order that begins at a cache line; of objects, at any address."""
    if np.dtype(dtype).hasobject:
        return np.zeros(shape, dtype)
    size = prod(shape) * np.dtype(dtype).itemsize
    room = np.zeros(size + LINE, np.uint8)
    first = -room.__array_interface__["data"][0] % LINE
    return room[first : first + size].view(dtype).reshape(shape)
