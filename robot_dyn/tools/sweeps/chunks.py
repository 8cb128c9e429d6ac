"""Fill a folder: submit the chunks that it lacks to an executor, until it has all of them.

Whether a chunk is done is asked of the folder alone, not of the executor.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from itertools import islice
from typing import Any

from robot_dyn.foundations import SweepError, shown
from robot_dyn.tools.sweeps.work import Stopped

_ATTEMPTS = 20  # rounds without a new file, after which a chunk is held to end its worker
_LOOK_S = 0.5


def fill(
    submit: Callable[[int], Future[Any]],
    missing: Callable[[], list[int]],
    capacity: Callable[[], int],
    look: Callable[[], object],
    lost: tuple[type[BaseException], ...] = (),
) -> None:
    """Submit chunks until the folder has all of them.

    Args:
        submit: Begins to make a chunk.
        missing: Numbers of the chunks that are left to do.
        capacity: Number of chunks that may be submitted at one time.
        look: Called meanwhile; an error of it, or Ctrl-C, ends the work.
        lost: Errors of workers that died, whose chunks are submitted again.

    Raises:
        SweepError: If a chunk always ends its worker.
        Exception: The first that making a chunk raised.
    """
    left, attempts = missing(), 0
    while left:
        waiting, pending = iter(left), set[Future[Any]]()
        try:
            while True:  # until each chunk was submitted once, and has ended in some way
                pending |= {submit(chunk) for chunk in islice(waiting, max(0, capacity() - len(pending)))}
                if not pending:
                    break
                look()
                ended, pending = wait(pending, _LOOK_S, FIRST_COMPLETED)
                for future in ended:
                    error = None if future.cancelled() else future.exception()
                    if error is not None and not isinstance(error, lost):
                        raise error
        finally:
            for future in pending:
                future.cancel()
        before, left = len(left), missing()
        attempts = attempts + 1 if len(left) == before else 0
        if attempts == _ATTEMPTS:
            raise SweepError(
                f"chunk {left[0]} ended its worker {_ATTEMPTS} times; make it in this process to see why, with"
                " the same folder and cluster=None"
            )


def fill_by_threads(
    make: Callable[[int, Callable[[float], object]], object],
    missing: Callable[[], list[int]],
    count: int,
    look: Callable[[], object],
) -> None:
    """Fill a folder by threads of this process; errors as in `fill`.

    Args:
        make: Makes a chunk and writes it, called with its number and a function to be called meanwhile, which raises
            `Stopped` when it is to end.
        missing: Numbers of the chunks that are left to do.
        count: Number of threads.
        look: As in `fill`.
    """
    stop = threading.Event()

    def check(_: float) -> None:
        if stop.is_set():
            raise Stopped

    def make_unless_stopped(chunk: int) -> None:
        with suppress(Stopped):
            check(0.0)
            make(chunk, check)

    with ThreadPoolExecutor(count) as pool:
        try:
            fill(lambda chunk: pool.submit(make_unless_stopped, chunk), missing, lambda: 2 * count, look)
        finally:
            stop.set()


def share_of(text: Any) -> tuple[int, int]:
    """Return job and number of jobs of a share such as "3/16"; None means all chunks.

    Raises:
        SweepError: If it is not a share.
    """
    if text is None:
        return 1, 1
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text) if isinstance(text, str) else None
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise SweepError(f"share: give job and number of jobs, such as '3/16' for the third of 16, got {shown(text)}")
    return int(match[1]), int(match[2])
