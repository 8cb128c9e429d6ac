"""Chunks by workers of Dask.distributed, on this machine or others that share the folder.

A task runs one chunk and returns nothing: the folder shows which chunks are done. Only a few tasks per worker are
submitted at a time, because a scheduler stores about 15 kB for each. Dask replaces workers that die, and chunks without
a file are submitted again.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from robot_dyn import RobotDynError
from robot_dyn.foundations import SweepError, needs
from robot_dyn.tools.sweeps.chunks import fill
from robot_dyn.tools.sweeps.folder import Folder, opened
from robot_dyn.tools.sweeps.imported import Named
from robot_dyn.tools.sweeps.work import Work

_WINDOW = 3  # submitted tasks per thread of a worker
_WAIT_S = 60.0  # longest time until the first worker is there


class Ticket(NamedTuple):
    """Data that a worker must agree on before it runs a chunk.

    Attributes:
        folder: Path of the folder, the same on all hosts.
        digest: SHA-256 of the specification in the folder.
        names: Scene and functions that the driver names, so that workers may import them.
    """

    folder: str
    digest: str
    names: Named


def fill_by_cluster(
    client: Any, folder: Folder, names: Named, missing: Callable[[], list[int]], look: Callable[[], object]
) -> None:
    """Fill a folder by the workers of a cluster.

    Args:
        client: Client of the cluster.
        folder: Folder to fill.
        names: Scene and functions that workers may import.
        missing: Function that returns the indices of missing chunks.
        look: Function that is called regularly; see `fill`.

    Raises:
        SweepError: If a worker sees another folder or has other versions; for other errors, see `fill`.
    """
    distributed = needs("distributed", extra="cluster")
    lost = distributed.KilledWorker, distributed.comm.CommClosedError, OSError
    ticket = Ticket(str(folder.path.absolute()), folder.digest, names)
    _check_workers(client, folder, ticket)
    executor = client.get_executor(pure=False, retries=0)

    def capacity() -> int:
        return _WINDOW * max(1, sum(client.nthreads().values()))

    fill(lambda chunk: executor.submit(make_chunk, ticket, chunk), missing, capacity, look, lost)


def _check_workers(client: Any, folder: Folder, ticket: Ticket) -> None:
    """Let each worker write a file into the folder, and check that the file exists here."""
    client.wait_for_workers(1, timeout=_WAIT_S)
    for worker, answer in client.run(_answer, ticket, on_error="return").items():
        if not isinstance(answer, str):
            why = str(answer) if isinstance(answer, RobotDynError) else f"{type(answer).__name__}: {answer}"
            raise SweepError(f"worker {worker}: {why}")
        try:
            (folder.path / answer).unlink()
        except FileNotFoundError:
            raise SweepError(
                f"worker {worker} writes to another folder than {folder.path}: give a folder that all hosts share"
            ) from None


# --- in a worker


def make_chunk(ticket: Ticket, chunk: int) -> None:
    """Run a chunk and write it, unless its file exists."""
    folder, work = _work(ticket)
    if not folder.file(chunk).exists():
        folder.write(chunk, *work.run_rows(*folder.run_range(chunk)))


def _answer(ticket: Ticket) -> str:
    """Write a file into the folder and return its name."""
    _work(ticket)
    name = f".{os.urandom(8).hex()}.unfinished"
    (Path(ticket.folder) / name).touch()
    return name


@lru_cache(maxsize=1)
def _work(ticket: Ticket) -> tuple[Folder, Work]:
    """Return folder and work of a sweep, created once per worker.

    Raises:
        SweepError: If the folder has another sweep than the driver's, or was begun with other versions of packages.
    """
    folder, sweep = opened(Path(ticket.folder), ticket.names, runs=True)
    if folder.digest != ticket.digest:
        raise SweepError(
            f"{folder.path} has another sweep than the driver's folder; give a folder that all hosts share"
        )
    return folder, Work(sweep)
