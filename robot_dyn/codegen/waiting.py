"""A wait that a person is told of: a line on stderr once it has taken a second, in a terminal or a notebook."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer

_AFTER_S = 1.0


@contextmanager
def told(what: str) -> Iterator[None]:
    """Say what a block, or a function, is doing where it takes longer than a second and a person watches."""
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
