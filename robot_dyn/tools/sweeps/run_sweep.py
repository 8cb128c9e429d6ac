"""`run` fills the folder of a sweep by threads, a cluster or a job of an array, or resumes it; `read_sweep` opens it.

A new folder begins with a pilot of 64 runs, which determines the size of chunks: about 2 s of work, constant from then
on. The pilot measures processor time, because wall time on a busy machine would lead to small chunks.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from shutil import disk_usage
from time import perf_counter, process_time
from typing import Any

from robot_dyn.codegen import thread_count
from robot_dyn.foundations import SweepError, check_folder, file_path, function, instance, integer, needs
from robot_dyn.simulation.rollouts.lock_step import LANES
from robot_dyn.tools.sweeps.chunks import fill_by_threads, share_of
from robot_dyn.tools.sweeps.folder import UNCUT, Folder, begin, folder_of, opened, read_design, write_design
from robot_dyn.tools.sweeps.imported import check_places, named
from robot_dyn.tools.sweeps.result import SweepResult
from robot_dyn.tools.sweeps.rows import FINISHED, RAISED
from robot_dyn.tools.sweeps.specification import (
    FILE,
    names_of,
    specification,
    stated_in,
)
from robot_dyn.tools.sweeps.sweep import Sweep, samples_of_run
from robot_dyn.tools.sweeps.work import Stopped, Work

Progress = Callable[[int, int], object]
_SCAN_S = 1.0  # time between scans of the folder
_RUNS = 64
_CHUNK_S = 2.0
_MOST = 16_384
_SAMPLE_BYTES = 2**26
_LEAST_CHUNKS = 32  # so that threads and machines share even a short sweep


def run(
    sweep: Sweep,
    folder: str | Path,
    *,
    threads: int | None = None,
    cluster: object = None,
    job: str | None = None,
    chunk: int | None = None,
    on_progress: Progress | None = None,
) -> SweepResult:
    """Make the missing runs of a sweep in a folder, and return the result.

    Several processes, on this machine or others, may fill one folder. Rows have the same bits in all cases. Ctrl-C
    drops unfinished chunks and raises KeyboardInterrupt; the folder keeps finished ones.

    Args:
        sweep: The sweep.
        folder: A new folder, or the folder of the same sweep.
        threads: Number of threads of this process; None for one for each processor.
        cluster: A `distributed.Client`, whose workers make the runs instead of threads.
        job: Part of the chunks, for example "3/16" in the third of 16 jobs.
        chunk: Number of runs in a file; None for about 2 s of work, by a pilot of 64 runs. Constant for a folder.
        on_progress: Function of the number of finished runs, and of all runs; None for a progress bar if stderr is a
            terminal.

    Raises:
        SweepError: If an argument is invalid, the folder contains another sweep, or a file cannot be written.
        KeyboardInterrupt: If Ctrl-C ends the work; call again to resume.
    """
    if on_progress is None:
        with _bar(sweep) as advance:
            return run(sweep, folder, threads=threads, cluster=cluster, job=job, chunk=chunk, on_progress=advance)
    instance("sweep", sweep, Sweep, "give a Sweep, such as sw.read_sweep(folder).sweep", error=SweepError)
    function("on_progress", on_progress, "the runs that are done and of all", error=SweepError)
    path, (number, jobs), work = file_path(folder, SweepError), share_of(job), Work(sweep)
    count = thread_count(threads)
    if cluster is not None:
        client = needs("distributed", extra="cluster").Client
        remedy = "give a distributed.Client, such as Client('tls://host:8786')"
        instance("cluster", cluster, client, remedy, error=SweepError)
        if job is not None or threads is not None:
            raise SweepError("cluster: its scheduler distributes the chunks; remove job and threads")
    check_places(path)
    check_folder(path, SweepError)
    _ = sweep.setup, work.record  # raises if a folder names functions that its reader has not named
    store = begun(sweep, path, chunk)
    store.prepare()
    last = 0.0

    def report_progress() -> None:
        nonlocal last
        if perf_counter() - last > _SCAN_S:
            last = perf_counter()
            on_progress(min(int(store.present().sum()) * store.chunk, store.runs), store.runs)

    def missing() -> list[int]:
        chunks = store.missing()
        return chunks[chunks % jobs == number - 1].tolist()

    def make(number: int, look: Callable[[float], object]) -> None:
        if not store.file(number).exists():  # another driver was first
            store.write(number, *work.run_rows(*store.run_range(number), look))

    if cluster is None:
        fill_by_threads(make, missing, count, report_progress)
    else:
        from robot_dyn.tools.sweeps.cluster import fill_by_cluster

        fill_by_cluster(cluster, store, names_of(sweep), missing, report_progress)
    if sweep.uncut and not len(store.missing()) and not (path / UNCUT).exists():
        with _interruptible():
            store.write_comparison(work.compared())
    last = -_SCAN_S
    report_progress()
    return SweepResult(sweep, store)


@contextmanager
def _bar(sweep: Sweep) -> Iterator[Progress]:
    """Yield a function that shows the finished runs, and their pace, in a progress bar on a terminal."""
    if not sys.stderr.isatty() or not isinstance(sweep, Sweep):
        yield lambda done, runs: None
        return
    from robot_dyn.cli import bar

    began, first = perf_counter(), None
    with bar(sweep.runs, "preparing") as advance:

        def show(done: int, runs: int) -> None:
            nonlocal first
            first = done if first is None else first
            rate = (done - first) / max(perf_counter() - began, 1e-9)
            pace = f", {rate:.3g} a second" if rate else ""  # nothing runs if the folder is complete
            advance(done, f"{done} of {runs} runs{pace}")

        yield show


def read_sweep(
    folder: str | Path, scene: str | Path | Callable[..., Any] | None = None, figures: Mapping[str, Any] | None = None
) -> SweepResult:
    """Return the result in the folder of a sweep.

    Functions that the folder names are imported only if you name them, too; tables and statistics do not need them.
    Before the import, their files are compared with the SHA-256 in the folder.

    Args:
        folder: Path of the folder, which may have been moved.
        scene: Present path of the scene file; None if it was not moved. For a sweep whose scene is a function: the
            function, or its import path "my_arm:setup", to repeat runs or to resume.
        figures: Functions, or their import paths, by name of figure, to resume a sweep with your own figures.

    Raises:
        SweepError: If the folder has no sweep, its scene is missing, the scene or a named function has changed, or
            Python imports from the folder.
    """
    store, sweep = opened(file_path(folder, SweepError), named(scene, figures))
    return SweepResult(sweep, store)


def begun(sweep: Sweep, path: Path, chunk: int | None = None) -> Folder:
    """Return the folder of a sweep, begin it if it is new; for arguments and errors, see `run`."""
    if chunk is not None:
        chunk = integer("chunk", chunk, least=1, most=2**31, error=SweepError)
    needs("pyarrow", extra="sweeps")
    stated = specification(sweep, chunk or 1)
    if not (path / FILE).is_file():
        _check_room(sweep, path)
        stated = stated.model_copy(update={"chunk": pilot(sweep, chunk)})
        begin(path, stated, sweep.points.rows)
    stored = stated_in(path)  # written by another driver, if that was first
    stored.check_same(stated.model_copy(update={"chunk": chunk or stored.chunk}), path)
    try:
        read_design(path, stored.rows_sha256)
    except SweepError:
        write_design(path, sweep.points.rows, stored.rows_sha256)
    return folder_of(path, sweep, stored)


def _check_room(sweep: Sweep, path: Path) -> None:
    """Raise a SweepError if the disk has less free space than the sweep needs."""
    there = next(folder for folder in (path.absolute(), *path.absolute().parents) if folder.exists())
    free = disk_usage(there).free
    if sweep.bytes_expected > free:
        sizes = f"{sweep.bytes_expected / 2**30:.3g} GiB, and {there} has {free / 2**30:.3g} GiB"
        raise SweepError(f"{path}: the sweep will take {sizes}; give another folder, fewer runs or fewer samples")


def pilot(sweep: Sweep, chunk: int | None = None) -> int:
    """Run the pilot, and return the number of runs of a chunk from its time, unless `chunk` is passed.

    The number is a multiple of the tile size, and samples take at most 64 MiB unless one tile takes more.

    Raises:
        SweepError: If no run finishes and some runs or their figures raise; with the first reason.
        KeyboardInterrupt: If Ctrl-C stops a run.
    """
    with _interruptible():
        return _pilot(Work(sweep), sweep, chunk)


@contextmanager
def _interruptible() -> Iterator[None]:
    """Raise KeyboardInterrupt if Ctrl-C stopped the runs of a block."""
    try:
        yield
    except Stopped:
        raise KeyboardInterrupt from None


def _pilot(work: Work, sweep: Sweep, chunk: int | None) -> int:
    """Run the pilot, see `pilot`; raise `Stopped` after Ctrl-C."""
    count = min(_RUNS, sweep.runs)
    rows = work.rows(0, count)  # includes compiling
    raised = rows["outcome"] == RAISED
    if raised.any() and not (rows["outcome"] == FINISHED).any():
        raise SweepError(
            f"none of the {count} pilot runs finishes, and {raised.sum()} raise errors; the first:"
            f" {rows['why'][raised][0]}"
        )
    if chunk is not None:
        return chunk
    began = process_time()
    work.rows(0, count)
    runs = _CHUNK_S * count / max(process_time() - began, 1e-9)
    most = min(_MOST, max(LANES, -(-sweep.runs // _LEAST_CHUNKS)))
    if sweep.samples is not None:
        size = 8 * samples_of_run(sweep.setup) * sweep.setup.plant.dynamics.n * len(sweep.samples.names)
        most = min(most, _SAMPLE_BYTES // size // LANES * LANES)
    return LANES * max(1, round(min(runs, most) / LANES))
