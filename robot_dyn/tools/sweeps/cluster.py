"""Chunks by workers of Dask.distributed, on this machine or others that share the folder.

A task runs one chunk and returns nothing: the folder shows which chunks are done. Only a few tasks per worker are
submitted at a time, because a scheduler stores about 15 kB for each. Dask replaces workers that die, and chunks without
a file are submitted again.
"""

from __future__ import annotations

import os
import re
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from ipaddress import ip_address
from pathlib import Path
from typing import Any, final
from urllib.parse import urlsplit

from robot_dyn import RobotDynError
from robot_dyn.foundations import SweepError, needs, shown
from robot_dyn.tools.sweeps.chunks import fill
from robot_dyn.tools.sweeps.folder import Folder, opened
from robot_dyn.tools.sweeps.imported import Named
from robot_dyn.tools.sweeps.specification import stated_in, versions
from robot_dyn.tools.sweeps.work import Work

_WINDOW = 3  # submitted tasks per thread of a worker
_WAIT_S = 60.0  # longest time until the first worker is there
# by default Dask profiles and monitors its processes every 20 ms, which takes 4 % of two processors
_LOCAL = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
}


@final
@dataclass(frozen=True)
class Ticket:
    """Data that a worker must agree on before it runs a chunk.

    Attributes:
        folder: Path of the folder, the same on all hosts.
        digest: SHA-256 of the specification in the folder.
        versions: Versions of packages at the driver.
        names: Scene and functions that the driver names.
    """

    folder: str
    digest: str
    versions: tuple[tuple[str, str], ...]
    names: Named


@contextmanager
def client_of(cluster: object) -> Iterator[Any]:
    """Connect to a cluster; "local:2x4" starts 2 processes with 4 threads each on this machine.

    Args:
        cluster: "local:2", "local:2x4"; the address of a scheduler, "tls://…", or "tcp://127.0.0.1:…" on this machine;
            or a client of the user, which is left open.

    Raises:
        SweepError: If the argument is none of these, or an address of another machine without TLS.
        MissingExtraError: If Dask.distributed is not installed.
    """
    distributed = needs("distributed", extra="cluster")
    if isinstance(cluster, distributed.Client):
        yield cluster
    elif isinstance(cluster, str) and cluster.startswith("local:"):
        with (
            needs("dask.config", extra="cluster").set(_LOCAL),
            _started(distributed, *_local(cluster)) as local,
            distributed.Client(local, set_as_default=False) as client,
        ):
            yield client
    elif isinstance(cluster, str) and "://" in cluster:
        _check_address(cluster)
        with _connected(distributed, cluster) as client:
            yield client
    else:
        raise SweepError(
            f"cluster: give 'local:2', the address of a scheduler such as 'tls://host:8786', or a"
            f" distributed.Client, got {shown(cluster)}"
        )


def _started(distributed: Any, processes: int, threads: int) -> Any:
    """Start a cluster on this machine; raise a SweepError if that fails, for example without shared memory."""
    try:
        return distributed.LocalCluster(
            n_workers=processes, threads_per_worker=threads, host="127.0.0.1", dashboard_address="127.0.0.1:0",
            protocol="tcp://", memory_limit=0, processes=True, silence_logs=50,
        )  # fmt: skip
    except (OSError, RuntimeError) as error:
        raise SweepError(f"cluster: Dask cannot start here ({error}); remove cluster to use threads") from None


def _connected(distributed: Any, address: str) -> Any:
    try:
        return distributed.Client(address, set_as_default=False)
    except OSError as error:
        raise SweepError(
            f"cluster: no scheduler answers at {address} ({error}); start one with dask scheduler"
        ) from None


def _local(text: str) -> tuple[int, int]:
    """Return the number of processes, and of threads of each."""
    match = re.fullmatch(r"local:([1-9]\d*)(?:x([1-9]\d*))?", text)
    if match is None:
        raise SweepError(f"cluster: 'local:2' is 2 processes, 'local:2x4' has 4 threads in each; got {shown(text)}")
    processes = int(match[1])
    return processes, int(match[2] or max(1, (os.cpu_count() or 1) // processes))


def _check_address(address: str) -> None:
    """Raise a SweepError for an address at which anybody who reaches the port could run code."""
    parts = urlsplit(address)
    with suppress(ValueError):
        if parts.hostname and ip_address(parts.hostname).is_loopback:
            return
    if parts.scheme not in ("tls", "wss") and parts.hostname != "localhost":
        raise SweepError(
            f"cluster: {address} is not encrypted, so anybody who reaches the port of the scheduler can run code on it:"
            " give tls://…, or your own distributed.Client with security= (SECURITY.md)"
        )


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
    ticket = ticket_of(folder, names)
    _check_workers(client, folder, ticket)
    executor = client.get_executor(pure=False, retries=0)

    def capacity() -> int:
        return _WINDOW * max(1, sum(client.nthreads().values()))

    fill(lambda chunk: executor.submit(make_chunk, ticket, chunk), missing, capacity, look, lost)


def ticket_of(folder: Folder, names: Named) -> Ticket:
    """Return the ticket of a folder, with the functions that workers may import."""
    return Ticket(str(folder.path.absolute()), folder.digest, tuple(versions().items()), names)


def _check_workers(client: Any, folder: Folder, ticket: Ticket) -> None:
    """Let each worker write a file into the folder, and check that the file exists here."""
    client.wait_for_workers(1, timeout=_WAIT_S)
    answers = client.run(_answer, ticket, on_error="return")
    files = {worker: folder.path / name for worker, name in answers.items() if isinstance(name, str)}
    strangers = [worker for worker, file in files.items() if not file.is_file()]
    for file in files.values():
        file.unlink(missing_ok=True)
    for worker, error in answers.items():
        if worker not in files:
            why = str(error) if isinstance(error, RobotDynError) else f"{type(error).__name__}: {error}"
            raise SweepError(f"worker {worker}: {why}")
    if strangers:
        raise SweepError(
            f"worker {strangers[0]} writes to another folder than {folder.path}: give a folder that all hosts share"
        )


# --- in a worker


def make_chunk(ticket: Ticket, chunk: int) -> None:
    """Run a chunk and write it, unless its file exists."""
    folder, work, t = _work(ticket)
    if not folder.file(chunk).exists():
        folder.write(chunk, *work.run_rows(*folder.run_range(chunk), t))


def _answer(ticket: Ticket) -> str:
    """Write a file into the folder and return its name."""
    _check(ticket)
    name = f".{os.urandom(8).hex()}.unfinished"
    (Path(ticket.folder) / name).touch()
    return name


@lru_cache(maxsize=1)
def _work(ticket: Ticket) -> Any:
    """Return folder, work and times of samples of a sweep, created once per worker."""
    _check(ticket)
    folder, sweep = opened(Path(ticket.folder), ticket.names)
    return folder, Work(sweep), None if folder.samples is None else folder.samples.times()


def _check(ticket: Ticket) -> None:
    """Raise a SweepError if folder or versions differ from the driver's."""
    here, host, digest = versions(), socket.gethostname(), ""
    for name, version in ticket.versions:
        if here.get(name) != version:
            difference = f"{name} is {here.get(name)} on {host}, but {version} at the driver"
            raise SweepError(f"{difference}; install the same version of {name} on both")
    with suppress(SweepError):
        digest = stated_in(Path(ticket.folder)).digest
    if digest != ticket.digest:
        raise SweepError(f"{ticket.folder} on {host} is not the folder of the driver; share one")
