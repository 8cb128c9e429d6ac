"""Ctrl-C while machine code is made: it waits, for what compiler and NumPy call back from C cannot raise."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interrupts_later() -> Iterator[None]:
    """Hold Ctrl-C back until the end of the block, or function; in another thread than the main one it never comes."""
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    noticed: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: noticed.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if noticed:
            signal.raise_signal(signal.SIGINT)
