"""Engines fill the folder: what they report is not believed, what dies is made again, what disagrees is refused."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from robot_dyn.foundations import SweepError
from robot_dyn.tools import sweeps as sw
from robot_dyn.tools.sweeps import begun, chunks, cluster, specification
from robot_dyn.tools.sweeps.chunks import fill_by_threads
from robot_dyn.tools.sweeps.cluster import fill_by_cluster
from robot_dyn.tools.sweeps.imported import NONE_NAMED
from robot_dyn.tools.sweeps.work import Stopped
from tests.tools.sweeps.swept import digest, names_in, swept


class Client:
    """A scheduler of one worker in this process, some of whose tasks do nothing and report that they are done."""

    def __init__(self, forgets: Callable[[int], bool] = lambda chunk: False) -> None:
        self.forgets, self.submitted = forgets, list[int]()

    def wait_for_workers(self, count: int, timeout: float) -> None: ...

    def nthreads(self) -> dict[str, int]:
        return {"tcp://127.0.0.1:1": 1}

    def run(self, function: Callable[..., Any], ticket: Any, on_error: str) -> dict[str, Any]:
        try:
            return {"tcp://127.0.0.1:1": function(ticket)}
        except SweepError as error:
            return {"tcp://127.0.0.1:1": error}

    def get_executor(self, **_: Any) -> Client:
        return self

    def submit(self, function: Callable[..., Any], ticket: Any, chunk: int) -> Future[Any]:
        self.submitted.append(chunk)
        future = Future[Any]()
        try:
            future.set_result(None if self.forgets(chunk) else function(ticket, chunk))
        except Exception as error:
            future.set_exception(error)
        return future


@pytest.fixture
def filled(tmp_path: Path) -> Iterator[Any]:
    """A folder of 10 chunks, none of which is made, and what the rows are."""
    pytest.importorskip("distributed")
    sweep = swept(tmp_path, 100)
    folder = begun(sweep, tmp_path / "out", chunk=10)
    folder.prepare()
    yield folder, digest(sweep)
    cluster._work.cache_clear()


def fill(client: Any, folder: Any, look: Callable[[], object] = lambda: None) -> None:
    fill_by_cluster(client, folder, NONE_NAMED, lambda: folder.missing().tolist(), look)


def test_completeness_is_asked_of_the_folder(filled: Any) -> None:
    """A scheduler that reports all done with chunks missing is asked for these again."""
    folder, expected = filled
    client = Client()
    client.forgets = lambda chunk: chunk in (3, 7) and client.submitted.count(chunk) < 3
    fill(client, folder)
    assert sorted(client.submitted) == sorted([*range(10), 3, 3, 7, 7])
    assert sw.read_sweep(folder.path).verify() == expected
    assert names_in(folder.path) == ["design", "rows", "sweep.json"]  # tokens are gone


def test_a_chunk_that_always_ends_its_worker_is_named(filled: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, _ = filled
    monkeypatch.setattr(chunks, "_ATTEMPTS", 4)
    client = Client(lambda chunk: chunk == 5)
    with pytest.raises(SweepError, match="chunk 5 crashed its worker 4 times"):
        fill(client, folder)
    assert folder.missing().tolist() == [5]


def test_an_error_of_a_task_is_raised(filled: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, _ = filled

    def full(*_: Any) -> None:
        raise SweepError("chunk 0 cannot be written (No space left on device)")

    monkeypatch.setattr(cluster.Folder, "write", full)
    with pytest.raises(SweepError, match="No space left"):
        fill(Client(), folder)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"digest": "of another one"}, "worker tcp://127.0.0.1:1: .* has another sweep than the driver's folder"),
        ({"path": Path("/proc")}, "worker tcp://127.0.0.1:1: /proc"),
    ],
)
def test_workers_that_disagree_are_refused_by_name(filled: Any, changes: Any, said: str) -> None:
    folder, _ = filled
    with pytest.raises(SweepError, match=said):
        fill(Client(), replace(folder, **changes))
    assert len(folder.missing()) == 10


def test_workers_with_other_versions_are_refused_by_name(filled: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(specification, "versions", lambda: {"scipy": "0.1"})
    with pytest.raises(SweepError, match=r"worker tcp://127.0.0.1:1: .*contains another sweep: versions"):
        fill(Client(), filled[0])


def test_workers_that_write_to_another_folder_are_refused(filled: Any) -> None:
    class Elsewhere(Client):  # reads the folder, as of a cache, and writes to another one
        def run(self, function: Any, ticket: Any, on_error: str) -> dict[str, Any]:
            return {"tcp://10.0.0.1:1": ".written elsewhere.unfinished"}

    with pytest.raises(SweepError, match=r"worker tcp://10.0.0.1:1 writes to another folder"):
        fill(Elsewhere(), filled[0])


def test_few_tasks_wait_at_a_scheduler(filled: Any) -> None:
    folder, _ = filled
    waiting, most = list[Callable[[], object]](), [0]

    class Slow(Client):
        def submit(self, function: Any, ticket: Any, chunk: int) -> Future[Any]:
            future = Future[Any]()
            waiting.append(lambda: future.set_result(function(ticket, chunk)))
            most[0] = max(most[0], len(waiting))
            return future

    fill(Slow(), folder, lambda: waiting.pop(0)())
    assert 2 <= most[0] <= 4 and not len(folder.missing())


@pytest.mark.parametrize("given", ["local:2", "tcp://10.0.0.3:8786", 3])
def test_clusters_that_are_no_clients_are_refused(tmp_path: Path, given: Any) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(SweepError, match=r"cluster: .*give a distributed\.Client"):
        sw.run(swept(tmp_path), tmp_path / "out", cluster=given)


@pytest.mark.parametrize("given", ["0/4", "5/4", "1/0", "1", "a/b", "1/4/2", 3, "-1/4"])
def test_shares_that_cannot_be_are_refused(tmp_path: Path, given: Any) -> None:
    with pytest.raises(SweepError, match="job: give its number and the number of jobs"):
        sw.run(swept(tmp_path), tmp_path / "out", job=given)


# --- threads


def test_ctrl_c_drops_the_chunks_under_way_keeps_the_rest_and_is_raised(tmp_path: Path) -> None:
    sweep, calls = swept(tmp_path, 600), []

    def interrupted(done: int, runs: int) -> None:
        calls.append(done)
        if len(calls) == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sw.run(sweep, tmp_path / "out", chunk=5, threads=2, on_progress=interrupted)
    done = sw.read_sweep(tmp_path / "out")
    assert 0 < len(done.missing) <= 120 and f"{len(done.missing)} of 120 chunks are missing" in repr(done)
    assert not list((tmp_path / "out" / "rows").glob(".*"))
    again = sw.run(sweep, tmp_path / "out")
    assert again.verify() == digest(sweep)


def test_an_error_of_a_chunk_ends_the_others_and_is_raised() -> None:
    made, ended = [], threading.Event()

    def make(chunk: int, look: Callable[[float], object]) -> None:
        if chunk == 2:
            raise SweepError("chunk 2 cannot be written")
        if chunk > 2:
            try:
                while True:
                    look(0.0)
            except Stopped:
                ended.set()
                raise
        made.append(chunk)

    with pytest.raises(SweepError, match="chunk 2"):
        fill_by_threads(make, lambda: list(range(100)), 2, lambda: None)
    assert set(made) <= {0, 1}


# --- workers of Dask in processes of their own


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")
def test_workers_in_processes_make_the_same_bits_and_one_that_is_killed_is_replaced(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    sweep = swept(tmp_path, 400)
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=2, host="127.0.0.1", dashboard_address=None) as local,
        distributed.Client(local, set_as_default=False) as client,
    ):
        pids, killed = list(client.run(os.getpid).values()), []

        def progress(done: int, runs: int) -> None:
            if not killed:
                killed.append(pids[0])
                os.kill(pids[0], signal.SIGKILL)

        done = sw.run(sweep, tmp_path / "out", chunk=5, cluster=client, on_progress=progress)
    assert killed and done.verify() == digest(sweep)
