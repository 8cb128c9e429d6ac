"""What a user notices of a compile: a line on stderr after a second, and Ctrl-C, which waits until the compile ends."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer

_AFTER_S = 1.0


@contextmanager
def announced(what: str) -> Iterator[None]:
    """Print what a block or function does if it takes longer than a second and stderr is watched by a person."""
    timer = Timer(_AFTER_S, lambda: print(f"robot_dyn: {what}", file=sys.stderr, flush=True))
    timer.daemon = True
    if _is_watched():
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _is_watched() -> bool:
    """Whether stderr is a terminal, or the output of a notebook's cell."""
    return sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)


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
