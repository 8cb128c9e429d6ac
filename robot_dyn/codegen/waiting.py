"""Compiling: the time it takes, and Ctrl-C, which is delayed until its end."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class _Compiling(threading.local):
    """Time that this thread has spent on loading and compiling loops, in [s]."""

    seconds = 0.0


COMPILING = _Compiling()


@contextmanager
def interrupts_later() -> Iterator[None]:
    """Delay Ctrl-C until the end of a block or function: callbacks from the C code of compilers cannot raise it.

    Python delivers it only to the main thread; other threads have nothing to delay.
    """
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    received: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if received:
            signal.raise_signal(signal.SIGINT)
