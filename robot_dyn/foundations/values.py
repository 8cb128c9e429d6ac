"""Values that hold arrays, read-only in copies too; values computed when they are read; caches; aligned arrays."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import fields
from functools import cached_property
from math import prod
from threading import RLock
from typing import TYPE_CHECKING, Any, TypeVar, final

import numpy as np

LINE = 64  # bytes of a cache line and of the widest vector: one that lies across two lines is two accesses

Result = TypeVar("Result")
Late = TypeVar("Late", bound="Derived")

_MOST = 64  # values that a cache by identity holds


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
    """An immutable value that caches what functions compute from it; copies and pickles have an empty cache."""

    @cached_property
    def cache(self) -> dict[Any, Any]:
        """Computed values, by the functions that computed them."""
        return {}

    def __getstate__(self) -> Any:
        return {name: x for name, x in vars(self).items() if name != "cache"}


def cached(
    value: Caching, compute: Callable[..., Result], *more: Any, lasts: Callable[[Result], bool] | None = None
) -> Result:
    """Return what a function of the value computes, from the cache if it was called before.

    Args:
        value: The first argument of the function.
        compute: Depends on the value alone, as far as its results are cached.
        *more: Further arguments.
        lasts: Whether a result is cached; all are by default.
    """
    if compute in value.cache:
        return value.cache[compute]
    result = compute(value, *more)
    if lasts is None or lasts(result):
        value.cache[compute] = result
    return result


@final
class LRUByIdentity:
    """A cache: values by hashable keys and by the identity of objects, for as long as these live; the latest ones."""

    def __init__(self) -> None:
        self._values: dict[tuple[Any, ...], tuple[list[weakref.ref[Any]], Any]] = {}
        self._lock = RLock()  # runs may start in several threads

    def get(self, objects: tuple[Any, ...], more: tuple[Any, ...], compute: Callable[[], Any]) -> Any:
        """The value of objects and of further, hashable values; it must not hold on to the objects."""
        key = (*map(id, objects), *more)
        with self._lock:
            entry = self._values.pop(key, None)
            if entry is None or any(ref() is not each for ref, each in zip(entry[0], objects, strict=True)):
                entry = [weakref.ref(each) for each in objects], compute()
            self._values[key] = entry
            while len(self._values) > _MOST or any(ref() is None for ref in next(iter(self._values.values()))[0]):
                del self._values[next(iter(self._values))]
            return entry[1]

    def known(self, objects: tuple[Any, ...], more: tuple[Any, ...]) -> Any:
        """The value that `get` would return without computing it, or None."""
        with self._lock:
            entry = self._values.get((*map(id, objects), *more))
            same = entry is not None and all(ref() is each for ref, each in zip(entry[0], objects, strict=True))
            return entry[1] if entry is not None and same else None


class Derived(Value):
    """A frozen dataclass that may be built from a source: each field is read from it at its first use.

    A field that may be read later has no default but by a factory: a default of the class would hide it.
    """

    if not TYPE_CHECKING:  # so that a type checker reports names that are not fields

        def __getattr__(self, name: str) -> Any:
            held = vars(self)
            if name in self.__dataclass_fields__ and (source := held.get("_source")) is not None:
                held.setdefault(name, _frozen(getattr(source, name)))  # two threads may compute it, and get one value
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
    """One whose fields are the attributes of the same name of a source, but for those that are given."""
    value = object.__new__(of)
    vars(value).update({name: _frozen(x) for name, x in known.items()})
    if len(known) < len(of.__dataclass_fields__):  # pyright: ignore[reportAttributeAccessIssue]
        vars(value)["_source"] = source
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


def several(value: Any) -> tuple[Any, ...] | None:
    """Return the entries of an iterable; None for anything else, such as an array without axes."""
    try:
        return tuple(value)
    except TypeError:
        return None


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


class OnFirstUse(dict[Any, Any]):
    """Values by name, each computed when it is first looked up."""

    def __init__(self, compute: Callable[[Any], Any]) -> None:
        super().__init__()
        self._compute = compute

    def __missing__(self, name: Any) -> Any:
        value = self[name] = self._compute(name)
        return value


def aligned(shape: tuple[int, ...], dtype: Any = float) -> np.ndarray:
    """An array of zeros in row-major order that begins at a cache line; of objects, at any address."""
    if np.dtype(dtype).hasobject:
        return np.zeros(shape, dtype)
    size = prod(shape) * np.dtype(dtype).itemsize
    room = np.zeros(size + LINE, np.uint8)
    first = -room.__array_interface__["data"][0] % LINE
    return room[first : first + size].view(dtype).reshape(shape)
