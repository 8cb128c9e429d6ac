"""Value classes whose arrays stay read-only in copies, fields computed on first access, caches, aligned arrays."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Hashable, Iterable
from dataclasses import fields
from functools import cached_property
from math import prod
from threading import RLock
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar, final

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance
    from numpy.typing import ArrayLike, DTypeLike

LINE = 64  # bytes of a cache line and of the widest vector; a vector that crosses a line needs two accesses

Result = TypeVar("Result")
Late = TypeVar("Late", bound="Derived")
Key = TypeVar("Key")
Item = TypeVar("Item")

_MAX = 64  # largest number of values in a cache by identity


class Value:
    """A value whose read-only arrays stay read-only through `copy.deepcopy` and `pickle`."""

    def __getstate__(self) -> tuple[dict[str, object], tuple[str, ...]]:
        state = dict(vars(self))
        return state, tuple(name for name, x in state.items() if _arrays(x) and not _writeable(x))

    def __setstate__(self, state: tuple[dict[str, object], tuple[str, ...]]) -> None:
        values, frozen = state
        vars(self).update(values)
        for name in frozen:
            for array in _arrays(values[name]):
                array.setflags(write=False)


class ReadOnly(Value):
    """A frozen dataclass whose arrays are made read-only on construction."""

    def __post_init__(self) -> None:
        read_only(self)  # pyright: ignore[reportArgumentType]


class ArrayField(Protocol):
    """The type of a field that accepts any numbers and returns an array."""

    def __get__(self, part: object, kind: type | None = None) -> np.ndarray: ...

    def __set__(self, part: object, values: ArrayLike) -> None: ...


class Caching:
    """An immutable value that caches what functions compute from it; copies and pickles have an empty cache."""

    @cached_property
    def cache(self) -> dict[Any, Any]:
        """Computed values, by the functions that computed them."""
        return {}

    def __getstate__(self) -> object:
        return {name: x for name, x in vars(self).items() if name != "cache"}


def cached(
    value: Caching, compute: Callable[..., Result], *more: object, lasts: Callable[[Result], bool] | None = None
) -> Result:
    """Return the result of a function of the value, from the cache if it was called before.

    Args:
        value: The first argument of the function.
        compute: The function; cached results must depend on the value only.
        *more: Further arguments.
        lasts: Predicate of results to cache; by default all are cached.
    """
    if compute in value.cache:
        return value.cache[compute]
    result = compute(value, *more)
    if lasts is None or lasts(result):
        value.cache[compute] = result
    return result


@final
class LRUByIdentity(Generic[Item]):
    """A cache of recent values by hashable keys and by the identity of objects, as long as the objects exist."""

    def __init__(self) -> None:
        self._values: dict[tuple[Hashable, ...], tuple[list[weakref.ref[object]], Item]] = {}
        self._lock = RLock()  # runs may start in several threads

    def get(self, objects: tuple[object, ...], more: tuple[Hashable, ...], compute: Callable[[], Item]) -> Item:
        """Return the value of objects and further hashable keys; the value must not refer to the objects."""
        key = (*map(id, objects), *more)
        with self._lock:
            entry = self._values.pop(key, None)
            if entry is None or any(ref() is not x for ref, x in zip(entry[0], objects, strict=True)):
                entry = [weakref.ref(x) for x in objects], compute()
            self._values[key] = entry
            while len(self._values) > _MAX or any(ref() is None for ref in next(iter(self._values.values()))[0]):
                del self._values[next(iter(self._values))]
            return entry[1]

    def cached_value(self, objects: tuple[object, ...], more: tuple[Hashable, ...]) -> Item | None:
        """Return the value that `get` would return without computing it, or None."""
        with self._lock:
            entry = self._values.get((*map(id, objects), *more))
            same = entry is not None and all(ref() is x for ref, x in zip(entry[0], objects, strict=True))
            return entry[1] if entry is not None and same else None


class Derived(ReadOnly):
    """A frozen dataclass that may be built from a source: a field is read from the source on first access.

    Such a field must not have a default, except a factory: a class attribute would hide the source.
    """

    if not TYPE_CHECKING:  # so that a type checker reports names that are not fields

        def __getattr__(self, name: str) -> Any:
            values = vars(self)
            if name in self.__dataclass_fields__ and (source := values.get("_source")) is not None:
                values.setdefault(name, _frozen(getattr(source, name)))  # if two threads compute it, both get one value
                if self.__dataclass_fields__.keys() <= values.keys():
                    values.pop("_source", None)  # nothing more is read from it
            if name not in values:  # checked last: another thread may have read the field and removed the source
                raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}", name=name, obj=self)
            return values[name]

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *(field.name for field in fields(self))} - {"_source"})  # pyright: ignore[reportArgumentType]

    def __getstate__(self) -> tuple[dict[str, object], tuple[str, ...]]:
        for field in fields(self):  # pyright: ignore[reportArgumentType]
            getattr(self, field.name)
        return super().__getstate__()


def derived(kind: type[Late], source: object, /, **values: object) -> Late:
    """Create an instance whose missing fields are read from `source` on first access."""
    value = object.__new__(kind)
    vars(value).update({name: _frozen(x) for name, x in values.items()})
    if len(values) < len(kind.__dataclass_fields__):  # pyright: ignore[reportAttributeAccessIssue]
        vars(value)["_source"] = source
    return value


def copied(x: Result) -> Result:
    """Return a copy of an array, or of a tuple with the arrays in it; other values unchanged."""
    return _copied(x)


def _copied(x: Any) -> Any:
    if isinstance(x, tuple):
        copies = [_copied(entry) for entry in x]
        return type(x)(*copies) if hasattr(x, "_fields") else tuple(copies)
    return x.copy() if isinstance(x, np.ndarray) else x


def read_only(value: DataclassInstance) -> None:
    """Replace the arrays of a frozen dataclass, and of dictionaries in it, by read-only views; nothing is copied."""
    for field in fields(value):
        x = getattr(value, field.name)
        if isinstance(x, dict | np.ndarray):
            object.__setattr__(value, field.name, _frozen(x))


def several(value: Iterable[Item]) -> tuple[Item, ...] | None:
    """Return the entries of an iterable; None for an array without axes, or for a value of another type."""
    try:
        return tuple(value)
    except TypeError:
        return None


def _frozen(x: Any) -> Any:
    """Return a read-only view of an array, or of the arrays in a dictionary; other values unchanged."""
    if isinstance(x, dict):
        return {key: _frozen(entry) for key, entry in x.items()}
    if isinstance(x, np.ndarray):
        x = x.view()
        x.setflags(write=False)
    return x


def _arrays(x: Any) -> list[np.ndarray]:
    """Return an array, or the arrays of a dictionary, as a list."""
    return [array for array in (x.values() if isinstance(x, dict) else (x,)) if isinstance(array, np.ndarray)]


def _writeable(x: Any) -> bool:
    return any(array.flags.writeable for array in _arrays(x))


class OnFirstUse(dict[Key, Item]):
    """Values by key, computed on first lookup."""

    def __init__(self, compute: Callable[[Key], Item]) -> None:
        super().__init__()
        self._compute = compute

    def __missing__(self, key: Key) -> Item:
        value = self[key] = self._compute(key)
        return value


def aligned(shape: tuple[int, ...], dtype: DTypeLike = float) -> np.ndarray:
    """Return an array of zeros in row-major order that begins at a cache line; for objects, at any address."""
    if np.dtype(dtype).hasobject:
        return np.zeros(shape, dtype)
    size = prod(shape) * np.dtype(dtype).itemsize
    buffer = np.zeros(size + LINE, np.uint8)
    first = -buffer.__array_interface__["data"][0] % LINE
    return buffer[first : first + size].view(dtype).reshape(shape)
