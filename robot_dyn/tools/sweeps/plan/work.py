"""The work of a chunk: runs start, …, stop − 1 of a sweep, as rows. A run that fails is a row with its reason.

Bits of a row depend on the sweep and the number of the run alone: not on the chunk, its parts or the threads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import final

import numpy as np

from robot_dyn import RobotDynError, Rollouts, Setup, Trajectory
from robot_dyn.foundations import SweepError, because
from robot_dyn.simulation import MOST_BYTES, parts_of_run
from robot_dyn.simulation.rollouts.batch import Batch
from robot_dyn.simulation.rollouts.lock_step import LANES
from robot_dyn.simulation.rollouts.rollouts import batch_of, manners, run_batch
from robot_dyn.tools.sweeps.folder.rows import FIXED, RAISED, Rows, empty, joined
from robot_dyn.tools.sweeps.folder.samples import check_times
from robot_dyn.tools.sweeps.plan.runs import Runs, taken
from robot_dyn.tools.sweeps.plan.sweep import STARTS, Sweep, samples_of_run

_PART_BYTES = 2**23  # that the runs of a part record; memory does not grow with the chunk, and allocators reuse blocks
Look = Callable[[float], object]


class Stopped(Exception):  # noqa: N818  it is not an error
    """The work is to end, and what was under way is dropped."""


@final
@dataclass(frozen=True, eq=False)
class Work:
    """How the runs of a sweep are made; one is used by all threads of a process.

    Attributes:
        sweep: What is swept.
    """

    sweep: Sweep

    @property
    def record(self) -> tuple[str, ...]:
        """What figures need recorded."""
        names = {name for each in self.sweep.figures.values() for name in each.record}
        names |= set(self.sweep.samples.names if self.sweep.samples else ())
        return tuple(name for name in ("q", "v", "u", "energy", "work") if name in names)

    @property
    def part(self) -> int:
        """Number of runs that are made together: whole tiles, as many as memory is for."""
        n, samples = self.sweep.setup.plant.dynamics.n, samples_of_run(self.sweep.setup)
        numbers = sum({"energy": 2, "work": 8}.get(name, n) for name in self.record)
        return LANES * max(1, min(256, _PART_BYTES // (8 * LANES * samples * max(1, numbers))))

    def rows(self, start: int, stop: int, look: Look | None = None) -> Rows:
        """The rows of runs start, …, stop − 1; `look` is called some ten times a second, and ends it by raising."""
        return self.made(start, stop, None, look)[0]

    def made(
        self, start: int, stop: int, t: np.ndarray | None, look: Look | None = None
    ) -> tuple[Rows, dict[str, np.ndarray]]:
        """The rows of runs start, …, stop − 1, and their samples at times t (m,), (k, m, n) by name."""
        kept, n = self.sweep.samples, self.sweep.setup.plant.dynamics.n
        names = () if kept is None or t is None else kept.names
        samples = {name: np.full((stop - start, len(t), n), np.nan) for name in names if t is not None}
        parts = []
        for a in range(start, stop, self.part):
            b = min(a + self.part, stop)
            parts.append(self._part(a, b, look, t, {name: x[a - start : b - start] for name, x in samples.items()}))
        return joined(parts), samples

    def times(self) -> np.ndarray:
        """Of the samples of the first run that finishes among 64, (m,), in [s]."""
        count = min(64, self.sweep.runs)
        for _, result in self._results(np.arange(count), self.sweep.values(0, count), None):
            if not isinstance(result, str) and not result.diverged.all():
                return result.t
        raise SweepError(f"samples: none of the first {count} runs finishes, so that their times are not known")

    def setup_of(self, i: int) -> Setup:
        """The setup of run i; SweepError with its reason if there is none."""
        setup, values = self.sweep.setup, {name: x[0] for name, x in self.sweep.values(i, i + 1).items()}
        starts = {name: values.pop(name) for name in STARTS if name in values}
        try:
            plant, controller = parts_of_run(setup, {name: _flat(x[None])[0] for name, x in values.items()}, i)
            return replace(setup, plant=plant, controller=controller, **starts)
        except RobotDynError as error:
            raise SweepError(f"run {i} raised: {error}") from None

    def run(self, i: int) -> Trajectory:
        """Run i as a trajectory; SweepError with its reason if it raised."""
        batch, reasons = self._batch(np.array([i]), self.sweep.values(i, i + 1), ("q", "v", "u", "energy", "work"))
        if batch is None:
            raise SweepError(f"run {i} raised: {reasons[0]}")
        ((_, passed),) = manners(batch)
        return run_batch(batch, passed, True, 1, MOST_BYTES)[0]

    def check_figures(self, start: int, stop: int) -> None:
        """Raise SweepError if a figure cannot be computed of runs, or its batch form gives other numbers."""
        for _, result in self._results(np.arange(start, stop), self.sweep.values(start, stop), None):
            if not isinstance(result, str) and not result.diverged.all():
                runs = Runs(taken(result, np.flatnonzero(~result.diverged)))
                for figure in self.sweep.figures.values():
                    figure.check(runs)

    def _part(
        self, start: int, stop: int, look: Look | None, t: np.ndarray | None = None,
        samples: Mapping[str, np.ndarray] = MappingProxyType({}),
    ) -> Rows:  # fmt: skip
        """The rows of some runs, and their samples, which are written into arrays."""
        values = self.sweep.values(start, stop)
        rows = empty(stop - start, self._columns(values), self.sweep.figures)
        for runs, result in self._results(np.arange(start, stop), values, look):
            at = runs - start
            if isinstance(result, str):
                rows["outcome"][at], rows["reason"][at] = RAISED, result
            else:
                self._write(rows, at, result)
                if samples and t is not None:
                    self._keep(samples, at, runs, result, t)
        return rows

    def _keep(
        self, samples: Mapping[str, np.ndarray], at: np.ndarray, runs: np.ndarray, result: Rollouts, t: np.ndarray
    ) -> None:
        """Samples of the runs of which some are kept."""
        check_times(result.t, t)
        assert self.sweep.samples is not None
        which = self.sweep.samples.of(runs, result.diverged)
        for name, x in samples.items():
            x[at[which], : len(result.t)] = getattr(result, name)[which]

    def _columns(self, values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """What varies, a column each."""
        columns = [x[:, k] for x in values.values() for k in range(x.shape[1])]
        return dict(zip(self.sweep.columns, columns, strict=True))

    def _write(self, rows: Rows, at: np.ndarray, result: Rollouts) -> None:
        """Rows of runs that were made; figures of those that finished."""
        for column in FIXED:
            rows[column.name][at] = column.values(result)
        whole = np.flatnonzero(~result.diverged)
        if not len(whole):
            return
        runs = Runs(result if len(whole) == len(result) else taken(result, whole))
        for name, figure in self.sweep.figures.items():
            try:
                rows[name][at[whole]] = figure.of(runs)
            except Exception:  # of a user's function: which runs it is of
                self._write_one_by_one(rows, name, at[whole], runs)

    def _write_one_by_one(self, rows: Rows, name: str, at: np.ndarray, runs: Runs) -> None:
        """A figure of each run by itself; a run of which it raises is one that raised, with that as its reason."""
        for i, place in enumerate(at.tolist()):
            try:
                rows[name][place] = self.sweep.figures[name].of(runs.only(i))[0]
            except Exception as error:
                rows["outcome"][place], rows["reason"][place] = RAISED, f"figure {name}: {because(error)}"

    def _results(
        self, runs: np.ndarray, values: dict[str, np.ndarray], look: Look | None
    ) -> Iterator[tuple[np.ndarray, Rollouts | str]]:
        """The rollouts of runs by their numbers; of one that raises, the reason."""
        batch, reasons = self._batch(runs, values, self.record)
        yield from ((runs[[i]], reason) for i, reason in reasons.items())
        if batch is not None:
            yield from _made(batch, look)

    def _batch(
        self, runs: np.ndarray, values: dict[str, np.ndarray], record: tuple[str, ...]
    ) -> tuple[Batch | None, dict[int, str]]:
        """The batch of the runs whose values are allowed; why those of the others are not, by place."""
        setup = replace(self.sweep.setup, estimate_error=False, accuracy=None)

        def batch(at: np.ndarray) -> Batch:
            q0, v0 = (values[name][at] if name in values else None for name in STARTS)
            params = {name: _flat(x[at]) for name, x in values.items() if name not in STARTS}
            return batch_of(setup, q0, v0, params, record, runs[at])

        try:
            return batch(np.arange(len(runs))), {}
        except RobotDynError:
            reasons: dict[int, str] = {}
        allowed = np.array(_allowed(batch, np.arange(len(runs)), reasons), int)
        return (batch(allowed) if len(allowed) else None), reasons


def _allowed(batch: Callable[[np.ndarray], Batch], places: np.ndarray, reasons: dict[int, str]) -> list[int]:
    """Which places make a batch, by halves; why the others do not, by place."""
    try:
        batch(places)
        return places.tolist()
    except RobotDynError as error:
        if len(places) == 1:
            reasons[int(places[0])] = str(error)
            return []
    half = len(places) // 2
    return _allowed(batch, places[:half], reasons) + _allowed(batch, places[half:], reasons)


def _made(batch: Batch, look: Look | None) -> Iterator[tuple[np.ndarray, Rollouts | str]]:
    """The rollouts of a batch, run by run where they raise together."""
    for places, passed in manners(batch):
        some = batch.some(places)
        numbers = batch.number_of(places)
        try:
            result = run_batch(some, passed, True, 1, MOST_BYTES, look)
        except (Stopped, MemoryError):
            raise
        except Exception as error:  # of the library, or of a user's code in a run
            if len(places) == 1:
                yield numbers, because(error)
                continue
            half = len(places) // 2
            yield from _made(some.some(np.arange(half)), look)
            yield from _made(some.some(np.arange(half, len(places))), look)
            continue
        if result.stopped.any():  # Ctrl-C came inside
            raise Stopped
        yield numbers, result


def _flat(x: np.ndarray) -> np.ndarray:
    """Values (B, 1) as (B,)."""
    return x[:, 0] if x.shape[1] == 1 else x
