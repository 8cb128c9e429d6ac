"""Work shared by threads: each free thread takes the next piece, so that slow threads do not delay others."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import final

from robot_dyn.foundations.validate import integer

_MAX_THREADS = 4096


def thread_count(threads: int | None) -> int:
    """Return a number of threads; None means all processors.

    Raises:
        QueryError: If it is not positive.
    """
    if threads is None:
        return os.cpu_count() or 1
    return integer("threads (None for all processors)", threads, least=1, most=_MAX_THREADS)


def shared(work: Callable[[int, int], int], count: int, piece: int, threads: int) -> int:
    """Return the largest result of work(start, stop) over pieces of 0 … count − 1, each of at least `piece` items.

    Args:
        work: Function that releases the interpreter's lock while it computes.
        count: Number of items, at least `piece`.
        piece: Number of items that a thread takes at a time; each piece starts at a multiple of it.
        threads: Maximum number of threads, including the caller.
    """
    pieces = max(1, count // piece)
    left = iter(range(pieces))  # calling next() on it is atomic

    def take() -> int:
        return max((work(i * piece, count if i == pieces - 1 else (i + 1) * piece) for i in left), default=0)

    others = _pool.submit(take, min(threads, pieces) - 1)
    return max(take(), *(other.result() for other in others)) if others else take()


@final
class _Pool:
    """Pool of waiting threads, because starting a thread takes as long as evaluating a thousand states."""

    def __init__(self) -> None:
        self._lock, self._size, self._threads = threading.Lock(), 0, ThreadPoolExecutor(1)

    def submit(self, work: Callable[[], int], count: int) -> list[Future[int]]:
        """Submit the work to `count` threads."""
        with self._lock:
            if count > self._size:
                self._threads.shutdown(wait=False)  # busy threads finish their work
                self._size, self._threads = count, ThreadPoolExecutor(count, "robot_dyn")
            return [self._threads.submit(work) for _ in range(count)]


_pool = _Pool()

if hasattr(os, "register_at_fork"):  # threads of the parent do not exist in a child
    os.register_at_fork(after_in_child=_pool.__init__)
