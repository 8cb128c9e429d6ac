"""Logging of long waits, to the logger "robot_dyn" at level INFO.

A script that does not configure logging prints nothing; the command line prints the messages to standard error.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer

LOG = logging.getLogger("robot_dyn")
PATIENCE_S = 2.0  # a shorter wait is not reported


@contextmanager
def log_if_slow(task: str) -> Iterator[None]:
    """Log the task of a block if it takes longer than `PATIENCE_S`."""
    if not LOG.isEnabledFor(logging.INFO):
        yield
        return
    timer = Timer(PATIENCE_S, LOG.info, ("%s", task))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
