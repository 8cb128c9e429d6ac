"""Work that threads share, followed by the caller: progress, Ctrl-C, and errors."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait

import numpy as np


def in_threads(
    work: Callable[[int], None], count: int, threads: int, stop: np.ndarray, look: Callable[[], object] | None = None
) -> None:
    """Call work(0), work(1), … up to the count, in so many threads.

    Args:
        work: What is called; an error of it is raised here, once all have ended.
        count: Number of calls.
        threads: Of these, at most.
        stop: Its first entry becomes 1 on Ctrl-C, or where `look` raises: what runs is to end soon, and so is what is
            called from then on. Ctrl-C raises nothing here.
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
