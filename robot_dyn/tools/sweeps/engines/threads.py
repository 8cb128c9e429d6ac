"""Chunks by the threads of this process."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from typing import final

from robot_dyn.tools.sweeps.plan.work import Stopped

_LOOK_S = 0.2


@final
class Threads:
    """So many threads, each of which takes the next chunk when it has made one.

    Args:
        make: Makes a chunk and writes it, called with its number and a function to be called meanwhile, which raises
            `Stopped` when it is to end.
        count: Of threads.
    """

    def __init__(self, make: Callable[[int, Callable[[float], object]], object], count: int) -> None:
        self._make, self._count = make, count
        self._lock, self._stop, self._error = threading.Lock(), threading.Event(), None

    def run(self, chunks: Iterable[int], look: Callable[[], object]) -> None:
        """Make the chunks; `look` is called meanwhile in this thread, and an error of it, or Ctrl-C, ends the work.

        Raises:
            Exception: The first that making a chunk raised, after the others under way have ended.
        """
        left = iter(chunks)
        threads = [threading.Thread(target=self._take, args=(left,), daemon=True) for _ in range(self._count)]
        try:
            for each in threads:
                each.start()
            for each in threads:
                while each.is_alive():
                    each.join(_LOOK_S)
                    look()
        finally:
            self._stop.set()
            for each in threads:
                if each.ident is not None:
                    each.join()
        if self._error is not None:
            raise self._error

    def _take(self, left: Iterable[int]) -> None:
        def look(_: float) -> None:
            if self._stop.is_set():
                raise Stopped

        while not self._stop.is_set():
            with self._lock:
                chunk = next(left, None)  # type: ignore[call-overload]
            if chunk is None:
                return
            try:
                self._make(chunk, look)
            except Stopped:
                return
            except BaseException as error:
                with self._lock:
                    self._error = self._error or error
                self._stop.set()
                return
