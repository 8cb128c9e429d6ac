"""Values that are kept for as long as what they were made of lives."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from threading import RLock
from typing import Any, final

_MOST = 64  # values that are kept


@final
class LRUByIdentity:
    """Values by hashable keys and by the identity of objects, for as long as all of these live; the latest ones."""

    def __init__(self) -> None:
        self._kept: dict[tuple[Any, ...], tuple[list[weakref.ref[Any]], Any]] = {}
        self._lock = RLock()  # runs may start in several threads

    def get(self, objects: tuple[Any, ...], more: tuple[Any, ...], make: Callable[[], Any]) -> Any:
        """The value of objects and of further, hashable values; it must not hold on to the objects."""
        key = (*map(id, objects), *more)
        with self._lock:
            found = self._kept.pop(key, None)
            if found is None or any(ref() is not each for ref, each in zip(found[0], objects, strict=True)):
                found = [weakref.ref(each) for each in objects], make()
            self._kept[key] = found
            while len(self._kept) > _MOST or any(ref() is None for ref in next(iter(self._kept.values()))[0]):
                del self._kept[next(iter(self._kept))]
            return found[1]

    def known(self, objects: tuple[Any, ...], more: tuple[Any, ...]) -> Any:
        """The value that `get` would give without making it, or None."""
        with self._lock:
            found = self._kept.get((*map(id, objects), *more))
            same = found is not None and all(ref() is each for ref, each in zip(found[0], objects, strict=True))
            return found[1] if found is not None and same else None
