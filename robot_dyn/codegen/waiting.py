"""Long waits: reported by logging, timed, and with Ctrl-C delayed until they end.

The logger is "robot_dyn", the level INFO. A script that does not configure logging prints nothing.
"""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer

LOG = logging.getLogger("robot_dyn")
PATIENCE_S = 2.0  # a shorter wait is not reported


class _Compiling(threading.local):
    """Time that this thread has spent on loading and compiling loops, in [s]; a run's first call does so."""

    seconds = 0.0


COMPILING = _Compiling()


@contextmanager
def log_if_slow(what: str) -> Iterator[None]:
    """Log what a block does, once it has taken longer than `PATIENCE_S`."""
    if not LOG.isEnabledFor(logging.INFO):
        yield
        return
    timer = Timer(PATIENCE_S, LOG.info, ("%s", what))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@contextmanager
def interrupts_later() -> Iterator[None]:
    """Delay Ctrl-C until the end of a block or function: callbacks from the C code of compilers cannot raise it.

    Python delivers it to the main thread only; in others there is nothing to delay.
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
