"""`run` fills the folder of a sweep by threads, a cluster or a job of an array, or resumes it; `read` opens it.

A folder begins with a pilot of 64 runs, from which the size of chunks follows: about 2 s of work, then fixed for ever.
Its time is that of the processor: a busy machine would give small chunks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from shutil import disk_usage
from time import perf_counter, process_time
from typing import Any

import numpy as np

from robot_dyn.codegen import thread_count
from robot_dyn.foundations import SweepError, check_folder, file_path, function, instance, integer, needs
from robot_dyn.simulation.rollouts.lock_step import LANES
from robot_dyn.tools.sweeps.chunks import fill_by_threads, share_of
from robot_dyn.tools.sweeps.folder import Folder, begin, folder_of, opened, read_design, write_design
from robot_dyn.tools.sweeps.imported import check_places, named
from robot_dyn.tools.sweeps.result import SweepResult
from robot_dyn.tools.sweeps.rows import FINISHED, RAISED
from robot_dyn.tools.sweeps.specification import (
    FILE,
    names_of,
    specification,
    stated_in,
)
from robot_dyn.tools.sweeps.sweep import Sweep
from robot_dyn.tools.sweeps.work import Work

Progress = Callable[[int, int], object]
_SCAN_S = 1.0  # between looks into the folder
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
    cluster: Any = None,
    share: str | None = None,
    chunk: int | None = None,
    on_progress: Progress | None = None,
) -> SweepResult:
    """Make the runs of a sweep that a folder lacks, and return what it holds.

    Several processes, on this machine or others, may fill one folder. Rows have the same bits whatever fills it.
    Ctrl-C ends the work and drops the chunks under way.

    Args:
        sweep: What to run.
        folder: A new folder, or that of the same sweep.
        threads: Of this process; None for all processors.
        cluster: Workers of Dask.distributed in place of them: "local:2", the address of a scheduler, or a `Client`.
        share: In the third of 16 jobs "3/16": only a part of the chunks.
        chunk: Runs of a file; None for about 2 s of work, by a pilot of 64 runs. Fixed once the folder is begun.
        on_progress: Called with the number of runs that are done, and of all.

    Raises:
        SweepError: If an argument is not allowed, the folder holds another sweep, or a file cannot be written.
    """
    instance("run takes a Sweep", sweep, Sweep, "sw.read(folder).sweep is that of a folder", error=SweepError)
    function("on_progress", on_progress, "the runs that are done and of all", error=SweepError)
    path, (job, jobs), work = file_path(folder, SweepError), share_of(share), Work(sweep)
    count = thread_count(threads)
    if cluster is not None and (share is not None or threads is not None):
        raise SweepError("cluster: its scheduler shares out the chunks; leave out share and threads")
    check_places(path)
    check_folder(path, SweepError)
    _ = sweep.setup, work.record  # refused if a folder names functions that its reader has not named
    known = begun(sweep, path, chunk)
    known.prepare()
    t, last = None if known.samples is None else known.samples.times(), 0.0

    def tell() -> None:
        nonlocal last
        if on_progress is not None and perf_counter() - last > _SCAN_S:
            last = perf_counter()
            on_progress(min(int(known.present().sum()) * known.chunk, known.runs), known.runs)

    def missing() -> list[int]:
        chunks = known.missing()
        return chunks[chunks % jobs == job - 1].tolist()

    def make(number: int, look: Callable[[float], object]) -> None:
        if not known.file(number).exists():  # another driver was first
            known.write(number, *work.made(*known.of(number), t, look))

    with suppress(KeyboardInterrupt):
        if cluster is None:
            fill_by_threads(make, missing, count, tell)
        else:
            from robot_dyn.tools.sweeps.cluster import client_of, fill_by_cluster

            with client_of(cluster) as client:
                fill_by_cluster(client, known, names_of(sweep), missing, tell)
    last = -_SCAN_S
    tell()
    return SweepResult(sweep, known)


def read(
    folder: str | Path, scene: str | Path | Callable[..., Any] | None = None, figures: Mapping[str, Any] | None = None
) -> SweepResult:
    """Return what the folder of a sweep holds.

    Functions that the folder names are imported only if you name them too; tables and statistics need none of them.
    Before the import, the file of each is compared with the SHA-256 that the folder states.

    Args:
        folder: It may have been moved.
        scene: Where the scene file lies now, None where it was. Of a sweep whose scene is a function: the function,
            or its import path "my_arm:setup", to repeat runs or to resume.
        figures: Functions, or their import paths, by name of figure, to resume a sweep with figures of your own.

    Raises:
        SweepError: If it holds none; if its scene is missing, or it or a named function has changed since; if Python
            imports from the folder.
    """
    known, sweep = opened(file_path(folder, SweepError), named(scene, figures))
    return SweepResult(sweep, known)


def begun(sweep: Sweep, path: Path, chunk: int | None = None) -> Folder:
    """The folder of a sweep, begun now unless it was; arguments and errors as in `run`."""
    if chunk is not None:
        chunk = integer("chunk", chunk, least=1, most=2**31, error=SweepError)
    needs("pyarrow", extra="sweeps")
    stated, t = specification(sweep, chunk or 1), None
    if not (path / FILE).is_file():
        _check_room(sweep, path)
        stated = stated.model_copy(update={"chunk": pilot(sweep, chunk)})
        t = None if sweep.samples is None else _times(sweep)  # before the folder holds a sweep that is refused
        begin(path, stated, sweep.points.rows)
    stored = stated_in(path)  # of another driver, if it was first
    stored.check_same(stated.model_copy(update={"chunk": chunk or stored.chunk}), path)
    try:
        read_design(path, stored.rows_sha256)
    except SweepError:
        write_design(path, sweep.points.rows, stored.rows_sha256)
    folder = folder_of(path, sweep, stored)
    if folder.samples is not None and not folder.present().any():
        folder.samples.create(_times(sweep) if t is None else t, sweep.setup.plant.dynamics.joint_names)
    return folder


def _times(sweep: Sweep) -> np.ndarray:
    """Times of the samples, (m,), in [s]; errors where samples cannot be kept."""
    needs("zarr", extra="sweeps")
    return Work(sweep).times()


def _check_room(sweep: Sweep, path: Path) -> None:
    """Raise SweepError if the disk has not as much room as the sweep will take."""
    there = next(folder for folder in (path.absolute(), *path.absolute().parents) if folder.exists())
    free = disk_usage(there).free
    if sweep.bytes_expected > free:
        sizes = f"{sweep.bytes_expected / 2**30:.3g} GiB, and {there} has {free / 2**30:.3g} GiB"
        raise SweepError(f"{path}: the sweep will take {sizes}; give another folder, fewer runs or fewer samples")


def pilot(sweep: Sweep, chunk: int | None = None) -> int:
    """The number of runs of a chunk, from the time of the pilot's runs unless it is given.

    It is in whole tiles, and its samples take at most 64 MiB unless those of one tile take more.

    Raises:
        SweepError: If none of them finishes and some raise, themselves or figures of them; says why.
    """
    work, count = Work(sweep), min(_RUNS, sweep.runs)
    rows = work.rows(0, count)  # with what is compiled first
    raised = rows["outcome"] == RAISED
    if raised.any() and not (rows["outcome"] == FINISHED).any():
        raise SweepError(
            f"none of the {count} runs of the pilot finishes, and {raised.sum()} raise; the first:"
            f" {rows['why'][raised][0]}"
        )
    if chunk is not None:
        return chunk
    began = process_time()
    work.rows(0, count)
    runs = _CHUNK_S * count / max(process_time() - began, 1e-9)
    most = min(_MOST, max(LANES, -(-sweep.runs // _LEAST_CHUNKS)))
    if sweep.samples is not None:
        size = 8 * len(work.times()) * sweep.setup.plant.dynamics.n * len(sweep.samples.names)
        most = min(most, _SAMPLE_BYTES // size // LANES * LANES)
    return LANES * max(1, round(min(runs, most) / LANES))
