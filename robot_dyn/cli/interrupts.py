"""Ctrl-C in the command line: delayed until after an import, inside which packages may swallow it."""

from __future__ import annotations

import signal
from threading import Timer
from types import FrameType

_AGAIN_S = 0.02


def guard() -> None:
    """Let Ctrl-C raise KeyboardInterrupt, after any import in progress, unless it is ignored."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # a shell ignores it in background processes
        signal.signal(signal.SIGINT, _interrupt)


def ignore() -> None:
    """Ignore Ctrl-C: the command has ended, and the interpreter shuts down."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _interrupt(number: int, frame: FrameType | None) -> None:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            later = Timer(_AGAIN_S, signal.raise_signal, (number,))
            later.daemon = True
            later.start()
            return
        frame = frame.f_back
    raise KeyboardInterrupt
