"""`run`: fill the folder of a sweep, by threads, a cluster or a job of an array; begun before, it is resumed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from time import perf_counter
from typing import Any

from robot_dyn.codegen import thread_count
from robot_dyn.foundations import SweepError, check_folder, file_path, shown
from robot_dyn.tools.sweeps.chunks import fill_by_threads, share_of
from robot_dyn.tools.sweeps.folder import Folder
from robot_dyn.tools.sweeps.imported import check_places, named
from robot_dyn.tools.sweeps.opening import begun, opened
from robot_dyn.tools.sweeps.result import SweepResult
from robot_dyn.tools.sweeps.specification import names_of
from robot_dyn.tools.sweeps.sweep import Sweep
from robot_dyn.tools.sweeps.work import Work

Progress = Callable[[int, int], object]
_SCAN_S = 1.0  # between looks into the folder


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
    if not isinstance(sweep, Sweep):
        raise SweepError(f"run takes a Sweep, got {shown(sweep)}; sw.read(folder).sweep is that of a folder")
    path, (job, jobs), work = file_path(folder, SweepError), share_of(share), Work(sweep)
    count = thread_count(threads)
    if on_progress is not None and not callable(on_progress):
        raise SweepError(
            f"on_progress must be a function of the runs that are done and of all, got {shown(on_progress)}"
        )
    if cluster is not None and (share is not None or threads is not None):
        raise SweepError("cluster: its scheduler shares out the chunks; leave out share and threads")
    check_places(path)
    check_folder(path, SweepError)
    _ = sweep.setup, work.record  # refused if a folder names functions that its reader has not named
    known = begun(sweep, path, chunk)
    known.prepare()
    tell, t = _Progress(known, on_progress), None if known.samples is None else known.samples.times()

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
    tell(True)
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
    path = file_path(folder, SweepError)
    known, sweep = opened(path, named(scene, figures))
    return SweepResult(sweep, known)


class _Progress:
    """Tells how many runs are done, as the folder has them, some once a second."""

    def __init__(self, folder: Folder, on_progress: Progress | None) -> None:
        self._folder, self._on_progress, self._last = folder, on_progress, 0.0

    def __call__(self, now: bool = False) -> None:
        if self._on_progress is not None and (now or perf_counter() - self._last > _SCAN_S):
            self._last = perf_counter()
            done = int(self._folder.present().sum()) * self._folder.chunk
            self._on_progress(min(done, self._folder.runs), self._folder.runs)
