"""A message on stderr during long compilations, and Ctrl-C, delayed until compilation ends."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer

_IN_TERMINAL_S, _IN_NOTEBOOK_S = 1.0, 2.0  # a notebook keeps the message in its output


class _Compiling(threading.local):
    """Time that this thread has spent on loading and compiling loops, in [s]."""

    seconds = 0.0


COMPILING = _Compiling()


@contextmanager
def announced(message: str) -> Iterator[None]:
    """Print a message if a block takes long and a person can see it: 1 s in a terminal, 2 s in a notebook."""
    after = _patience_s()
    if after is None:
        yield
        return
    timer = Timer(after, lambda: print(f"robot_dyn: {message}", file=sys.stderr, flush=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _patience_s() -> float | None:
    """Return the time after which a message is printed; None if stderr is neither a terminal nor a notebook."""
    if sys.stderr is None:
        return None
    if sys.stderr.isatty():
        return _IN_TERMINAL_S
    return _IN_NOTEBOOK_S if "ipykernel" in sys.modules else None


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
