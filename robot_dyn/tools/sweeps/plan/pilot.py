"""The pilot: 64 runs, from which the size of chunks follows: about 2 s of work, then fixed for ever.

Its time is that of the processor: a busy machine would give small chunks.
"""

from __future__ import annotations

from time import process_time

from robot_dyn.foundations import SweepError
from robot_dyn.simulation.rollouts.lock_step import LANES
from robot_dyn.tools.sweeps.folder.rows import RAISED
from robot_dyn.tools.sweeps.plan.sweep import Sweep
from robot_dyn.tools.sweeps.plan.work import Work

_RUNS = 64
_CHUNK_S = 2.0
_MOST = 16_384
_SAMPLE_BYTES = 2**26
_LEAST_CHUNKS = 32  # so that threads and machines share even a short sweep


def pilot(sweep: Sweep, chunk: int | None = None) -> int:
    """The number of runs of a chunk, from the time of the pilot's runs unless it is given.

    Raises:
        SweepError: If all of them raise, or a figure cannot be computed of them; says why.
    """
    work, count = Work(sweep), min(_RUNS, sweep.runs)
    rows = work.rows(0, count)  # with what is compiled first
    if (rows["outcome"] == RAISED).all():
        raise SweepError(f"all {count} runs of the pilot raise; the first: {rows['reason'][0]}")
    work.check_figures(0, count)
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
