"""Chunks by workers of Dask.distributed, on this machine or others that share the folder.

A task makes one chunk and returns nothing: what is done is asked of the folder. A few tasks for each worker are
submitted at a time, since a scheduler keeps some 15 kB for each. Workers that die are replaced by Dask, and chunks
without a file are submitted again.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from ipaddress import ip_address
from itertools import islice
from pathlib import Path
from queue import Empty, Queue
from typing import Any, final
from urllib.parse import urlsplit

from robot_dyn import RobotDynError
from robot_dyn.foundations import SweepError, needs, shown
from robot_dyn.tools.sweeps.folder.files import temporary_name, write
from robot_dyn.tools.sweeps.folder.folder import Folder
from robot_dyn.tools.sweeps.imported import NOTHING, Named
from robot_dyn.tools.sweeps.opening import opened
from robot_dyn.tools.sweeps.plan.specification import versions

_WINDOW = 3  # tasks a thread of a worker
_ATTEMPTS = 20  # rounds without a new file, after which a chunk is held to end its worker
_WAIT_S = 60.0  # for the first worker
_LOOK_S = 0.5
# what a process of Dask does beside its tasks, a profile and a look at itself each 20 ms, is 4 % of two processors
_LOCAL = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
}


@final
@dataclass(frozen=True)
class Ticket:
    """What a worker must agree on before it makes a chunk.

    Attributes:
        folder: Path of the folder, the same on all hosts.
        digest: Of the specification in it.
        token: Name of a file in the folder, and its content.
        versions: Of the driver.
        scene: What the driver names, as in `Named`.
        figures: Same.
    """

    folder: str
    digest: str
    token: str
    versions: tuple[tuple[str, str], ...]
    scene: str | None = None
    figures: tuple[tuple[str, str], ...] = ()


@contextmanager
def client_of(cluster: Any) -> Iterator[Any]:
    """A client of a cluster: "local:2" and "local:2x4" are so many processes, of so many threads, on this machine.

    Args:
        cluster: Such a text; the address of a scheduler, "tls://…", or "tcp://127.0.0.1:…" of this machine; or a client
            of the user, which is left open.

    Raises:
        SweepError: If it is none of these, or an address of another machine without TLS.
        MissingExtraError: Without Dask.distributed.
    """
    distributed = needs("distributed", extra="cluster")
    if isinstance(cluster, distributed.Client):
        yield cluster
    elif isinstance(cluster, str) and cluster.startswith("local:"):
        processes, threads = _local(cluster)
        with (
            needs("dask.config", extra="cluster").set(_LOCAL),
            _started(distributed, processes, threads) as local,
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
    """A cluster on this machine; SweepError if it cannot start, as where there is no shared memory."""
    try:
        return distributed.LocalCluster(
            n_workers=processes, threads_per_worker=threads, host="127.0.0.1", dashboard_address="127.0.0.1:0",
            protocol="tcp://", memory_limit=0, processes=True, silence_logs=50,
        )  # fmt: skip
    except (OSError, RuntimeError) as error:
        raise SweepError(f"cluster: Dask cannot start here ({error}); leave cluster out, to use threads") from None


def _connected(distributed: Any, address: str) -> Any:
    try:
        return distributed.Client(address, set_as_default=False)
    except OSError as error:
        raise SweepError(
            f"cluster: no scheduler answers at {address} ({error}); start one with dask scheduler"
        ) from None


def _local(text: str) -> tuple[int, int]:
    """Processes and threads of each."""
    processes, _, threads = text.removeprefix("local:").partition("x")
    if not processes.isdigit() or int(processes) < 1 or (threads and not (threads.isdigit() and int(threads))):
        raise SweepError(f"cluster: 'local:2' is 2 processes, 'local:2x4' has 4 threads in each; got {shown(text)}")
    return int(processes), int(threads) if threads else max(1, (os.cpu_count() or 1) // int(processes))


def _check_address(address: str) -> None:
    """Refuse an address at which whoever reaches the port could run code."""
    parts = urlsplit(address)
    with suppress(ValueError):
        if parts.hostname and ip_address(parts.hostname).is_loopback:
            return
    if parts.scheme not in ("tls", "wss") and parts.hostname != "localhost":
        raise SweepError(
            f"cluster: {address} is not encrypted, and whoever reaches an open port of a scheduler runs code on it:"
            " give tls://…, or a distributed.Client with security=, which you made yourself (SECURITY.md)"
        )


@final
class Cluster:
    """Workers of Dask.

    Args:
        client: Of the cluster.
        folder: That is filled.
        names: Scene and functions that workers may import.
    """

    def __init__(self, client: Any, folder: Folder, names: Named = NOTHING) -> None:
        self._client, self._folder = client, folder
        path = folder.path.absolute()
        self._key = f"token-{os.urandom(8).hex()}"
        token = temporary_name(self._key)
        figures = tuple(names.figures.items())
        self._ticket = Ticket(str(path), folder.digest, token, tuple(versions().items()), names.scene, figures)

    def run(self, chunks: Callable[[], list[int]], look: Callable[[], object]) -> None:
        """Make the chunks that the folder lacks; `look` is called meanwhile.

        Args:
            chunks: Those that are left to do, asked of the folder.
            look: An error of it, or Ctrl-C, ends the work.

        Raises:
            SweepError: If a worker sees another folder or has other versions, or a chunk always ends its worker.
        """
        token = self._folder.path / self._ticket.token
        write(token, self._ticket.token.encode())
        try:
            self._handshake()
            left, attempts = chunks(), 0
            while left:
                self._round(left, look)
                before, left = len(left), chunks()
                attempts = attempts + 1 if len(left) == before else 0
                if attempts == _ATTEMPTS:
                    raise SweepError(
                        f"chunk {left[0]} ended its worker {_ATTEMPTS} times; make it in this process to see why, with"
                        " the same folder and cluster=None"
                    )
        finally:
            for each in self._folder.path.glob(f".{self._key}.*"):
                each.unlink(missing_ok=True)

    def _handshake(self) -> None:
        """Every worker reads the token and writes one back, which is read here."""
        self._client.wait_for_workers(1, timeout=_WAIT_S)
        for worker, answer in self._client.run(_answer, self._ticket, on_error="return").items():
            if isinstance(answer, BaseException):
                why = str(answer) if isinstance(answer, RobotDynError) else f"{type(answer).__name__}: {answer}"
                raise SweepError(f"worker {worker}: {why}")
            if not (self._folder.path / answer).is_file():
                raise SweepError(
                    f"worker {worker} writes to another folder than {self._folder.path}: give one that all hosts share"
                )

    def _round(self, chunks: list[int], look: Callable[[], object]) -> None:
        """Submit chunks, a few for each worker at a time, until each has ended in some way."""
        left, pending, ended = iter(chunks), set[Any](), Queue[Any]()
        try:
            while True:
                most = _WINDOW * max(1, sum(self._client.nthreads().values()))
                for chunk in islice(left, max(0, most - len(pending))):
                    future = self._client.submit(make_chunk, self._ticket, chunk, pure=False, retries=0)
                    pending.add(future)
                    future.add_done_callback(ended.put)
                if not pending:
                    return
                look()
                with suppress(Empty):
                    future = ended.get(timeout=_LOOK_S)
                    pending.discard(future)
                    _raise_error_of(future)
        finally:
            self._client.cancel(list(pending), force=True)


def _raise_error_of(future: Any) -> None:
    """Raise what a task raised; a worker that died is no error, since the folder lacks its chunk."""
    distributed = needs("distributed", extra="cluster")
    if future.status != "error":
        return
    error = future.exception()
    if not isinstance(error, distributed.KilledWorker | distributed.comm.CommClosedError | OSError):
        raise error


# --- in a worker


def make_chunk(ticket: Ticket, chunk: int) -> None:
    """Make a chunk and write it, unless its file is there."""
    folder, work, t = _work(ticket)
    if not folder.file(chunk).exists():
        folder.write(chunk, *work.made(*folder.of(chunk), t))


def _answer(ticket: Ticket) -> str:
    """Write a token beside that of the driver; its name."""
    _check(ticket)
    name = temporary_name(ticket.token.split(".")[1])
    write(Path(ticket.folder) / name, ticket.token.encode())
    return name


@lru_cache(maxsize=1)
def _work(ticket: Ticket) -> Any:
    """The folder, the work and the times of samples of a sweep, made once in a worker."""
    _check(ticket)
    folder, work = opened(Path(ticket.folder), Named(ticket.scene, dict(ticket.figures)))
    if folder.digest != ticket.digest:
        raise SweepError(f"{ticket.folder}: holds another sweep here than at the driver; give one that all hosts share")
    return folder, work, None if folder.samples is None else folder.samples.times()


def _check(ticket: Ticket) -> None:
    """Refuse another folder, and other versions, by name."""
    token = Path(ticket.folder) / ticket.token
    if not token.is_file() or token.read_text() != ticket.token:
        raise SweepError(f"{ticket.folder} on {socket.gethostname()} is not the folder of the driver; share one")
    here = versions()
    for name, version in ticket.versions:
        if here.get(name) != version:
            raise SweepError(
                f"{name} is {here.get(name)} on {socket.gethostname()}, {version} at the driver; install it there"
            )
