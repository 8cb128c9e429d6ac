"""The folder of a sweep, opened or begun.

It begins with a pilot of 64 runs, from which the size of chunks follows: about 2 s of work, then fixed for ever. Its
time is that of the processor: a busy machine would give small chunks.
"""

from __future__ import annotations

from pathlib import Path
from shutil import disk_usage
from time import process_time

import numpy as np

from robot_dyn.foundations import SceneError, SweepError, integer, needs
from robot_dyn.simulation.rollouts.lock_step import LANES
from robot_dyn.tools.sweeps.folder import (
    Folder,
    begin,
    has_specification,
    mend_design,
    read_design,
    read_specification,
)
from robot_dyn.tools.sweeps.imported import NOTHING, Named, check_places
from robot_dyn.tools.sweeps.rows import RAISED
from robot_dyn.tools.sweeps.sample_store import SampleStore
from robot_dyn.tools.sweeps.specification import Specification, parsed, processor, specification, versions
from robot_dyn.tools.sweeps.sweep import Sweep
from robot_dyn.tools.sweeps.work import Work

_RUNS = 64
_CHUNK_S = 2.0
_MOST = 16_384
_SAMPLE_BYTES = 2**26
_LEAST_CHUNKS = 32  # so that threads and machines share even a short sweep


def opened(path: Path, names: Named = NOTHING) -> tuple[Folder, Sweep]:
    """The folder of a sweep, and the sweep; arguments and errors as in `read`."""
    check_places(path)
    where = str(path / "sweep.json")
    stored = parsed(read_specification(path), where)
    try:
        sweep = stored.sweep(read_design(path, stored.rows_sha256), where, names, path)
    except SceneError as error:
        raise SweepError(f"{where}: {error}; sw.read(folder, scene=…), --scene, where it lies now") from None
    stored.check_same(specification(sweep, stored.chunk), where, versions=False)
    return _folder(path, sweep, stored), sweep


def begun(sweep: Sweep, path: Path, chunk: int | None = None) -> Folder:
    """The folder of a sweep, begun now unless it was; arguments and errors as in `run`."""
    if chunk is not None:
        chunk = integer("chunk", chunk, least=1, most=2**31, error=SweepError)
    needs("pyarrow", extra="sweeps")
    where, t = str(path / "sweep.json"), None
    if has_specification(path):
        stored = parsed(read_specification(path), where)
        stated = specification(sweep, chunk or stored.chunk)
    else:
        _check_room(sweep, path)
        stated = specification(sweep, pilot(sweep, chunk))
        t = None if sweep.samples is None else _times(sweep)  # before the folder holds a sweep that is refused
        begin(path, stated.text, sweep.points.rows, stated.rows_sha256)
        stored = parsed(read_specification(path), where)
    stored.check_same(stated, where)
    mend_design(path, sweep.points.rows, stored.rows_sha256)
    folder = _folder(path, sweep, stored)
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


def _folder(path: Path, sweep: Sweep, stated: Specification) -> Folder:
    store = sweep.samples and SampleStore(path / "samples", stated.runs, stated.chunk, sweep.samples)
    names, about = (*sweep.columns, *sweep.figures), {"versions": versions()} | processor()
    return Folder(path, stated.runs, stated.chunk, stated.digest, names, about, store)


def pilot(sweep: Sweep, chunk: int | None = None) -> int:
    """The number of runs of a chunk, from the time of the pilot's runs unless it is given.

    Raises:
        SweepError: If all of them raise, or a figure cannot be computed of them; says why.
    """
    work, count = Work(sweep), min(_RUNS, sweep.runs)
    rows = work.rows(0, count, check=True)  # with what is compiled first
    if (rows["outcome"] == RAISED).all():
        raise SweepError(f"all {count} runs of the pilot raise; the first: {rows['reason'][0]}")
    if chunk is not None:
        return chunk
    began = process_time()
    work.rows(0, count)
    run_s = (process_time() - began) / count
    return min(chunk_of(run_s, sweep.runs), most_of_samples(sweep, work))


def most_of_samples(sweep: Sweep, work: Work) -> int:
    """Number of runs of which samples take 64 MiB, in whole tiles."""
    if sweep.samples is None:
        return _MOST
    size = 8 * len(work.times()) * sweep.setup.plant.dynamics.n * len(sweep.samples.names)
    return LANES * max(1, _SAMPLE_BYTES // (size * LANES))


def chunk_of(run_s: float, runs: int) -> int:
    """About 2 s of runs that take so long, in whole tiles."""
    most = min(_MOST, max(LANES, -(-runs // _LEAST_CHUNKS)))
    tiles = max(1, round(min(_CHUNK_S / max(run_s, 1e-9), most) / LANES))
    return tiles * LANES
