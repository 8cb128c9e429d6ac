"""Fill a folder: submit missing chunks to an executor until the folder has all of them.

Only the folder shows whether a chunk is done, not the executor.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from itertools import islice
from typing import TypeVar

from robot_dyn.foundations import SweepError, shown
from robot_dyn.tools.sweeps.work import Stopped

Done = TypeVar("Done")
_ATTEMPTS = 20  # rounds without a new file, after which a chunk is assumed to kill its worker
_LOOK_S = 0.5


def fill(
    submit: Callable[[int], Future[Done]],
    missing: Callable[[], list[int]],
    capacity: Callable[[], int],
    look: Callable[[], object],
    lost: tuple[type[BaseException], ...] = (),
) -> None:
    """Submit chunks until the folder has all of them.

    Args:
        submit: Function that starts the work on a chunk.
        missing: Function that returns the indices of missing chunks.
        capacity: Function that returns the number of chunks that may be submitted at a time.
        look: Function that is called regularly; an error in it, or Ctrl-C, ends the work.
        lost: Errors of workers that died; their chunks are submitted again.

    Raises:
        SweepError: If a chunk repeatedly kills its worker.
        Exception: The first exception of a chunk.
    """
    left, attempts = missing(), 0
    while left:
        waiting, pending = iter(left), set[Future[Done]]()
        try:
            while True:  # until each chunk was submitted once and has ended
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
                f"chunk {left[0]} crashed its worker {_ATTEMPTS} times; to see the cause, run it in this process with"
                " the same folder and cluster=None"
            )


def fill_by_threads(
    make: Callable[[int, Callable[[float], object]], object],
    missing: Callable[[], list[int]],
    count: int,
    look: Callable[[], object],
) -> None:
    """Fill a folder by threads of this process; for errors, see `fill`.

    Args:
        make: Function that runs and writes a chunk; its arguments are the index of the chunk and a function that it
            must call regularly, which raises `Stopped` to end the work.
        missing: Function that returns the indices of missing chunks.
        count: Number of threads.
        look: Function that is called regularly; see `fill`.
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


def share_of(text: object) -> tuple[int, int]:
    """Return job and number of jobs of a share such as "3/16"; None means all chunks.

    Raises:
        SweepError: If the text is not a share.
    """
    if text is None:
        return 1, 1
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text) if isinstance(text, str) else None
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise SweepError(
            f"job: give its number and the number of jobs, such as '3/16' for the third of 16, got {shown(text)}"
        )
    return int(match[1]), int(match[2])
