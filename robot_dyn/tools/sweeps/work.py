"""The work of a chunk: runs start, …, stop − 1 of a sweep, as rows. The row of a failed run contains the reason.

The bits of a row depend only on the sweep and the number of the run, not on the chunk, its parts or the threads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from robot_dyn import RobotDynError, Rollouts, Setup, Trajectory
from robot_dyn.foundations import SweepError, located_message
from robot_dyn.simulation import MOST_BYTES, parts_of_run
from robot_dyn.simulation.rollouts.batch import Batch
from robot_dyn.simulation.rollouts.comparison import Comparison, differences, drawn
from robot_dyn.simulation.rollouts.lock_step import LANES
from robot_dyn.simulation.rollouts.rollouts import batch_of, run_batch, stepping_groups
from robot_dyn.tools.sweeps.figures import Runs
from robot_dyn.tools.sweeps.kept_samples import longest, until_end
from robot_dyn.tools.sweeps.rows import FIXED, RAISED, Rows, empty, joined
from robot_dyn.tools.sweeps.sweep import STARTS, Sweep, samples_of_run

_PART_BYTES = 2**23  # bytes recorded by the runs of a part: memory is independent of the chunk, and blocks are reused
_RECORDS = ("q", "v", "u", "energy", "work")
Look = Callable[[float], object]


@final
@dataclass(frozen=True)
class OneByOne:
    """Runs simulated one by one, not in lock step.

    Attributes:
        runs: Number of these runs.
        runs_s: Time of these runs, in [s].
        all_s: Time of all runs, in [s].
    """

    runs: int
    runs_s: float
    all_s: float

    def __add__(self, other: OneByOne) -> OneByOne:
        return OneByOne(self.runs + other.runs, self.runs_s + other.runs_s, self.all_s + other.all_s)


IN_LOCK_STEP = OneByOne(0, 0.0, 0.0)


@final
@dataclass(frozen=True)
class Facts:
    """Facts about the runs of a chunk, for the footer of its file.

    Attributes:
        one_by_one: Runs simulated one by one.
        t: Times of the samples, in [s]; empty if a sweep keeps no samples.
        joints: Names of the joints of the samples; empty if a sweep keeps no samples.
    """

    one_by_one: OneByOne
    t: tuple[float, ...] = ()
    joints: tuple[str, ...] = ()


class Stopped(Exception):  # noqa: N818  not an error
    """A request to end the work and drop unfinished chunks."""


@final
@dataclass(frozen=True, eq=False)
class Work:
    """Execution of the runs of a sweep, shared by all threads of a process.

    Attributes:
        sweep: The sweep.
        cut: True to end steps at thresholds even if the sweep is uncut, for comparison.
    """

    sweep: Sweep
    cut: bool = False

    @property
    def uncut(self) -> bool:
        """True if steps pass thresholds."""
        return self.sweep.uncut and not self.cut

    @property
    def record(self) -> tuple[str, ...]:
        """Quantities to record for figures and samples."""
        names = {name for figure in self.sweep.figures.values() for name in figure.record}
        names |= set(self.sweep.samples.names if self.sweep.samples else ())
        return tuple(name for name in _RECORDS if name in names)

    @property
    def part(self) -> int:
        """Number of runs that are simulated together: a multiple of the tile size, limited by memory."""
        n, samples = self.sweep.setup.plant.dynamics.n, samples_of_run(self.sweep.setup)
        numbers = sum({"energy": 2, "work": 8}.get(name, n) for name in self.record)
        return LANES * max(1, min(256, _PART_BYTES // (8 * LANES * samples * max(1, numbers))))

    def rows(self, start: int, stop: int) -> Rows:
        """Return the rows of runs start, …, stop − 1."""
        return self.run_rows(start, stop)[0]

    def compared(self) -> Comparison:
        """Make some runs, drawn at random, uncut and with steps that end at thresholds, and compare their figures."""
        sweep, runs = self.sweep, drawn(self.sweep.runs, self.sweep.seed)
        values = [sweep.values(run, run + 1) for run in runs.tolist()]
        by_name = {name: np.concatenate([of[name] for of in values]) for name in values[0]}
        uncut, cut = (Work(sweep, cut)._rows(runs, by_name) for cut in (False, True))
        others = int((uncut["outcome"] != cut["outcome"]).sum())
        figures = {name: uncut[name] for name in sweep.figures}
        return Comparison(len(runs), sweep.runs, others, tuple(differences(figures, cut, sweep.units)))

    def run_rows(self, start: int, stop: int, look: Look | None = None) -> tuple[Rows, Facts]:
        """Make runs.

        Args:
            start: The first run.
            stop: The run after the last.
            look: Function called about ten times a second; it ends the work by raising.

        Returns:
            The rows of the runs, and facts about them.

        Raises:
            SweepError: If samples are kept, and the runs are not sampled at the same times.
        """
        parts, alone, t = list[Rows](), IN_LOCK_STEP, np.empty(0)

        def use(result: Rollouts) -> None:
            nonlocal alone, t
            ran = result.statistics
            alone += OneByOne(ran.one_by_one, ran.one_by_one_s, ran.wall_s)
            t = t if self.sweep.samples is None else longest(t, result.t)

        for first in range(start, stop, self.part):
            last = min(first + self.part, stop)
            parts.append(self._rows(np.arange(first, last), self.sweep.values(first, last), look, use))
        joints = () if self.sweep.samples is None else self.sweep.setup.plant.dynamics.joint_names
        return joined(parts), Facts(alone, tuple(t.tolist()), joints)

    def _rows(
        self,
        runs: np.ndarray,
        values: dict[str, np.ndarray],
        look: Look | None = None,
        use: Callable[[Rollouts], object] = lambda result: None,
    ) -> Rows:
        """Return the rows of runs with these numbers, in order, and call `use` with the rollouts of some of them."""
        columns = np.column_stack(list(values.values())).T
        samples = self.sweep.samples.columns.values() if self.sweep.samples else ()
        rows = empty(len(runs), dict(zip(self.sweep.columns, columns, strict=True)), self.sweep.figures, samples)
        for some, result in self._results(runs, values, look):
            places = np.searchsorted(runs, some)
            if isinstance(result, str):
                rows["why"][places] = result
            else:
                self._write(rows, places, some, result)
                use(result)
        return rows

    def setup_of(self, i: int) -> Setup:
        """Return the setup of run i; raise a SweepError with the reason if it is invalid."""
        setup, values = self.sweep.setup, {name: x[0] for name, x in self.sweep.values(i, i + 1).items()}
        starts = {name: values.pop(name) for name in STARTS if name in values}
        try:
            plant, controller = parts_of_run(setup, values, i)
            return replace(setup, plant=plant, controller=controller, **starts)
        except RobotDynError as error:
            raise SweepError(f"run {i} raised: {error}") from None

    def run(self, i: int) -> Trajectory:
        """Return run i as a trajectory; raise a SweepError with the reason if it raised an error."""
        batch, reasons = self._batch(np.array([i]), self.sweep.values(i, i + 1), _RECORDS)
        if batch is None:
            raise SweepError(f"run {i} raised: {reasons[0]}")
        ((_, passed),) = stepping_groups(batch)
        return run_batch(batch, passed, self.uncut, 1, MOST_BYTES)[0]

    def _write(self, rows: Rows, at: np.ndarray, numbers: np.ndarray, result: Rollouts) -> None:
        """Write the results of runs with their numbers into rows, with figures for runs that finished."""
        for column in FIXED:
            rows[column.name][at] = column.values(result)
        if (selection := self.sweep.samples) is not None:
            for i in np.flatnonzero(selection.selected(numbers, result.diverged)):
                for name, column in selection.columns.items():
                    rows[column][at[i]] = until_end(getattr(result, name)[i])
        places = np.flatnonzero(~result.diverged)
        if not len(places):
            return
        runs, at = Runs(result, places), at[places]
        for name, figure in self.sweep.figures.items():
            try:
                rows[name][at] = figure.values(runs)
            except Exception:  # in a user's function: find the runs for which it raises
                for i, place in enumerate(at.tolist()):
                    try:
                        rows[name][place] = figure.values(runs.only(i))[0]
                    except Exception as error:
                        rows["outcome"][place] = rows["reason"][place] = RAISED
                        rows["why"][place] = f"figure {name}: {located_message(error)}"

    def _results(
        self, runs: np.ndarray, values: dict[str, np.ndarray], look: Look | None = None
    ) -> Iterator[tuple[np.ndarray, Rollouts | str]]:
        """Yield the rollouts of runs with their numbers; the reason for a run that raises."""
        batch, reasons = self._batch(runs, values, self.record)
        yield from ((runs[[i]], reason) for i, reason in reasons.items())
        if batch is None:
            return

        def made(places: np.ndarray) -> list[tuple[np.ndarray, Rollouts]]:
            some, results = batch.some(places), []
            for at, passed in stepping_groups(some):
                result = run_batch(some.some(at), passed, self.uncut, 1, MOST_BYTES, look)
                if result.stopped.any():  # Ctrl-C during the runs
                    raise Stopped
                results.append((some.number_of(at), result))
            return results

        for places, results in _in_halves(np.arange(len(batch)), made):
            yield from (
                [(batch.number_of(places), located_message(results))] if isinstance(results, Exception) else results
            )

    def _batch(
        self, runs: np.ndarray, values: dict[str, np.ndarray], record: tuple[str, ...]
    ) -> tuple[Batch | None, dict[int, str]]:
        """Return the batch of runs with valid values, and the reasons for the others, by index."""
        setup = replace(self.sweep.setup, estimate_error=False, accuracy=None)

        def batch(at: np.ndarray) -> Batch:
            chosen = {name: x[at] for name, x in values.items()}
            q0, v0 = (chosen.pop(name, None) for name in STARTS)
            return batch_of(setup, q0, v0, chosen, record, runs[at])

        attempts = list(_in_halves(np.arange(len(runs)), batch))
        reasons = {int(at[0]): located_message(result) for at, result in attempts if isinstance(result, Exception)}
        if not reasons:
            return attempts[0][1], {}
        allowed = [i for i in range(len(runs)) if i not in reasons]
        return (batch(np.array(allowed)) if allowed else None), reasons


def _in_halves(places: np.ndarray, attempt: Callable[[np.ndarray], Any]) -> Iterator[tuple[np.ndarray, Any]]:
    """Yield the results of `attempt` for places, or for their halves if it raises; the error for a single place."""
    try:
        result = attempt(places)
    except (Stopped, MemoryError):
        raise
    except Exception as error:  # in the library, or in user code
        if len(places) == 1:
            yield places, error
        else:
            half = len(places) // 2
            yield from _in_halves(places[:half], attempt)
            yield from _in_halves(places[half:], attempt)
        return
    yield places, result
