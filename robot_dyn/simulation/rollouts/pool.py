"""A thread pool whose caller receives progress, Ctrl-C and errors."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait

import numpy as np


def in_threads(
    work: Callable[[int], None], count: int, threads: int, stop: np.ndarray, look: Callable[[], object] | None = None
) -> None:
    """Call work(0), …, work(count − 1) in threads.

    Args:
        work: Function to call; its error is raised here after all calls have ended.
        count: Number of calls.
        threads: Largest number of threads.
        stop: Array whose first entry becomes 1 on Ctrl-C, or if `look` raises an error. Calls in progress and later
            ones must then end soon. Ctrl-C raises no error here.
        look: Called some ten times a second, in the thread of the caller.
    """
    with ThreadPoolExecutor(min(threads, count), "robot_dyn") as pool:
        futures = [pool.submit(work, i) for i in range(count)]
        try:
            while wait(futures, timeout=0.1).not_done:
                if look is not None:
                    look()
        except BaseException as error:
            stop[0] = 1
            wait(futures)
            if not isinstance(error, KeyboardInterrupt):
                raise
    for future in futures:
        future.result()
