"""A batch of runs in tiles of 64 in lock step, each tile run by one thread from beginning to end.

Records are arrays over time, row and run, in this order, so that a tile writes whole vectors. Where `simulate` cuts
steps at thresholds, the runs that may pass one are repeated by themselves, and replace those of lock step.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import cast, final

import numpy as np

from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.arithmetic import FLOAT64
from robot_dyn.foundations.coefficients import with_values
from robot_dyn.integrate.integrator import PlainMethod
from robot_dyn.model.right_angles import robot_of
from robot_dyn.simulation.compiled.machine_code import MachineCode
from robot_dyn.simulation.dynamics.loop_state import Ended, Now, Runs, Why, rules_of, runs_of
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.events.detection import Detecting
from robot_dyn.simulation.observation.observation import observations_of, observed
from robot_dyn.simulation.results.statistics import Statistics
from robot_dyn.simulation.rollouts.batch import Batch, Ends, advice_of
from robot_dyn.simulation.rollouts.one_by_one import OneByOne, Single
from robot_dyn.simulation.rollouts.pool import in_threads
from robot_dyn.simulation.rollouts.result import Rollouts
from robot_dyn.simulation.rollouts.thresholds import Thresholds
from robot_dyn.simulation.run.fixed_step import samples_at_most
from robot_dyn.simulation.run.outcome import Ending, Outcome
from robot_dyn.simulation.run.recording import records_of
from robot_dyn.simulation.run.watch import LARGEST, diverged_advice
from robot_dyn.simulation.setup.schedule import ON_STEP
from robot_dyn.simulation.setup.segment_table import segment_table
from robot_dyn.simulation.setup.setup import Setup

LANES = 64  # runs in a tile: with 8, 16 or 32 a step of RK4 took 1.5, 1.1 and 1.05 times as long
_REASONS = {
    Why.GOES_ON: "",
    Why.OVERFLOWED: "a number overflowed",
    Why.GAINED: "energy grows without a source",
    Why.NOT_FOUND: "the stages of a step are not found",
}
_INSTANTS = 200  # at least, or every step, at which an actuation that changes between ticks is observed


@final
class Tiles:
    """The tiles of a batch and what they record: time by row by run, so that a tile writes whole vectors.

    Args:
        batch: The runs.
        code: Their state equation.
        extras: What machine code records beside the state, as in `machine_code`.
        most: Number of bytes to record at most.
        thresholds: At which `simulate` cuts steps; None if it cuts none, or cuts are not requested.
    """

    def __init__(
        self, batch: Batch, code: MachineCode, extras: tuple[str, ...], most: int,
        thresholds: Thresholds | None = None,
    ) -> None:  # fmt: skip
        setup, recorded = batch.setup, batch.recorded
        equation, n = code.compiled_form, code.compiled_form.plant.dynamics.n
        self.batch, self.setup, self.code, self.extras = batch, setup, code, extras
        self.y, self.thresholds = _starts(equation, batch.q0, batch.v0), thresholds
        self.levels = batch.levels(equation.plant, equation.controller)
        places = {
            "q": range(n),
            "v": range(n, 2 * n),
            "work": range(equation.size - len(equation.sources), equation.size),
        }
        self.states = [name for name in places if name in recorded and name not in extras]
        self.columns = [column for name in self.states for column in places[name]]
        tiles = -(-len(batch) // LANES)
        width, more = tiles * LANES, sum(batch.sizes[name] for name in extras)
        batch.check_size(most)
        self.table, self.apart = segment_table(setup), 0
        steps = int(self.table.counts[:-1].sum())
        if "actuation" in code.code.programs:
            self.apart = 1 if equation.sampled else max(1, steps // _INSTANTS)
        self.instants = steps // self.apart if self.apart > 1 else 0
        rows = samples_at_most(setup, self.table.counts)
        self.out_y, self.out_extras = np.empty((rows, len(self.columns), width)), np.empty((rows, more, width))
        numbers = np.minimum(np.arange(width), len(batch) - 1)
        start = np.vstack([batch.q0[numbers].T, batch.v0[numbers].T, np.full((n, width), np.nan)])
        self.observations = observations_of(start, self.levels.of_runs(numbers), tiles)
        self.t = np.zeros(0)  # of the samples of the tile that has most, in [s]
        self.lock = threading.Lock()
        self.unfinished = np.ones(tiles, dtype=bool)
        self.why, self.last = np.zeros(width, np.int64), np.zeros((equation.size, width))
        self.ended, self.until = np.full(width, setup.duration_s), np.full(width, np.inf)
        self.again: dict[int, Single | None] = {}  # runs repeated by themselves; None where Ctrl-C came first
        self.clocks = np.tile([0.0, setup.record_period_s, ON_STEP * setup.nominal_step_s], (tiles, 1))
        self.evaluations, self.stop = np.zeros(tiles, np.int64), np.zeros(1, np.int64)

    def run(self, threads: int, on_progress: Callable[[float], object] | None = None) -> Rollouts:
        """All tiles, each by one thread; Ctrl-C ends them at their next step, and an error of `on_progress`."""
        began, end, reached = perf_counter(), self.setup.duration_s, 0.0

        def report(t: float) -> None:
            nonlocal reached
            reached = max(reached, t)
            if on_progress is not None:
                on_progress(reached)

        in_threads(self._tile, len(self.unfinished), threads, self.stop, lambda: report(self._reached()))
        self._make_again(threads, report)
        result = self._result()
        if on_progress is not None and not result.stopped.any():
            report(end)
        return replace(result, statistics=replace(result.statistics, wall_s=perf_counter() - began))

    def _reached(self) -> float:
        """The time reached, in [s], the mean over the runs: that of the next sample of each that goes on."""
        end, left = self.setup.duration_s, np.isinf(self.until).reshape(-1, LANES).mean(axis=1)
        return float((left * np.where(self.unfinished, np.minimum(self.clocks[:, 0], end), end)).mean())

    def _make_again(self, threads: int, report: Callable[[float], object]) -> None:
        """Make those runs by themselves that may have passed a threshold, or diverged, where steps are cut."""
        if self.thresholds is None:
            return
        passed = np.isfinite(self.until) | (self.why > 0)
        numbers = np.flatnonzero(passed[: len(self.batch)])
        self.again = dict.fromkeys(numbers.tolist())
        if not len(numbers) or self.stop[0]:
            return
        runs = OneByOne(self.batch.some(numbers), self.levels.of_runs(numbers))
        part = len(numbers) / len(self.batch)
        runs.run(threads, lambda t: report((1 - part) * self.setup.duration_s + part * t))
        self.again = dict(zip(numbers.tolist(), runs.records, strict=True))

    def _write_again(self, t: np.ndarray) -> None:
        """What these runs recorded, in place of what lock step gave; without them, that up to their thresholds."""
        for run, single in self.again.items():
            if single is None:
                rows = int(np.searchsorted(t, self.until[run], side="right"))
            else:
                rows = len(single.t)
                for array, of in ((self.out_y, self.states), (self.out_extras, self.extras)):
                    array[:rows, :, run] = np.hstack([*(single.columns[name] for name in of), np.empty((rows, 0))])
            self.out_y[rows:, :, run], self.out_extras[rows:, :, run] = np.nan, np.nan

    def _runs(self, tile: int) -> Runs:
        """The runs of a tile at their start; a tile that is not full repeats a run."""
        equation, index = self.code.compiled_form, self._numbers(tile)
        run_parameters = self.code.run_parameters({name: x[index] for name, x in self.batch.sweep.items()})
        return runs_of(equation, self.y[index].T, run_parameters, self.out_extras.shape[1], self.batch.number_of(index))

    def _numbers(self, tile: int) -> np.ndarray:
        """The numbers of the runs in a tile."""
        return np.minimum(np.arange(tile * LANES, (tile + 1) * LANES), len(self.batch) - 1)

    def _tile(self, tile: int) -> None:
        equation, n = self.code.compiled_form, self.setup.plant.dynamics.n
        lanes, runs = slice(tile * LANES, (tile + 1) * LANES), self._runs(tile)
        method = cast(PlainMethod, self.setup.integrator)
        assert self.code.machine_loop is not None
        advance = self.code.machine_loop.calls()
        rows = equation.size | 1  # odd: stages a power of two apart would share the sets of a cache
        stepper = method.stepper(FLOAT64, equation.size, n, rows, LANES)
        functions, now = self.code.code.addresses, np.zeros(len(Now), dtype=np.int64)
        now[Now.BUDGET] = np.iinfo(np.int64).max
        none = np.empty((0, equation.size))
        records = records_of(
            np.array(self.columns, np.int64), self.out_y, self.out_extras, none, none, np.empty((1 + 3 * n, 0)),
            self.observations[tile],
        )  # fmt: skip
        rules = rules_of(equation, False, LARGEST, base=lanes.start, apart=self.apart)
        work = stepper.work
        if self.thresholds is not None:
            positions = 0 if equation.canonical else n
            switches = self.thresholds.lanes(self._numbers(tile), equation.size, positions)
            self.until[lanes] = switches.until
            work = Detecting(work, work.K, switches._replace(until=self.until[lanes]))
        ended = advance(
            functions, self.table, runs, records, rules, stepper.coefficients, work, now, self.clocks[tile], self.stop
        )
        self.unfinished[tile], self.evaluations[tile] = ended != Ended.DONE, now[Now.EVALUATIONS]
        with self.lock:
            if now[Now.ROW] > len(self.t):
                self.t = records.t[: now[Now.ROW]]
        self.why[lanes], self.last[:, lanes] = runs.why, runs.last
        self.ended[lanes] = np.where(runs.why > 0, runs.ended, self.setup.duration_s)
        if ended != Ended.DONE:
            reached = self.table.starts[now[Now.SEGMENT]] + now[Now.STEP] * self.table.lengths[now[Now.SEGMENT]]
            self.ended[lanes] = np.where(runs.why > 0, runs.ended, reached)
            for array in (self.out_y, self.out_extras):
                array[int(now[Now.ROW]) :, :, lanes] = np.nan

    def _result(self) -> Rollouts:
        B, t = len(self.batch), self.t
        self._write_again(t)
        why, ended = self.why[:B], self.ended[:B].copy()
        diverged, advice, steps = why > 0, self._advice(why), self._steps(ended)
        stopped = np.repeat(self.unfinished, LANES)[:B] & ~diverged
        evaluations = np.repeat(self.evaluations, LANES)[:B]
        for run, single in self.again.items():
            outcome = Outcome(Ending.STOPPED, min(self.until[run], ended[run])) if single is None else single.outcome
            ended[run], advice[run] = outcome.t, advice_of(outcome)
            diverged[run], stopped[run] = (outcome.ending is each for each in (Ending.DIVERGED, Ending.STOPPED))
            if single is not None:
                steps[run], evaluations[run] = single.steps, single.evaluations
        alone = {run: single.observation for run, single in self.again.items() if single is not None}
        recorded, sizes = dict[str, np.ndarray](), self.batch.sizes
        for array, names in ((self.out_y, self.states), (self.out_extras, self.extras)):
            by_run = np.moveaxis(array[: len(t), :, :B], -1, 0)
            ends = np.cumsum([0, *(sizes[name] for name in names)])
            recorded |= {name: by_run[..., a:b] for name, a, b in zip(names, ends, ends[1:], strict=False)}
        return self.batch.rollouts(
            self._setup_compiled(), t, recorded,
            Ends(ended, diverged, stopped, tuple(advice), steps, evaluations), self._statistics(),
            observed(self.observations, self.levels, alone, self.instants)[:B],
        )  # fmt: skip

    def _setup_compiled(self) -> Setup:
        """The setup whose equations were compiled: right angles of the file written out in full."""
        plant, controller = self.setup.plant, self.setup.controller
        if controller is not None:
            models = {name: robot_of(each) or each for name, each in controller.models.items()}
            controller = with_values(controller, models)
        plant = Plant(robot_of(plant.dynamics) or plant.dynamics, plant.effects)
        return replace(self.setup, plant=plant, controller=controller)

    def _advice(self, why: np.ndarray) -> list[str]:
        """Why runs diverged and what to do; nothing for the others."""
        advice, equation = [""] * len(why), self.code.compiled_form
        for run in np.flatnonzero(why).tolist():
            fastest = equation.fastest_joint(self.last[:, run])
            advice[run] = diverged_advice(_REASONS[Why(why[run])], fastest, self.setup)
        return advice

    def _steps(self, ended: np.ndarray) -> np.ndarray:
        """Number of steps of each run up to its end."""
        table = self.table
        lengths = np.where(table.lengths > 0, table.lengths, 1.0)
        segment = np.maximum(np.searchsorted(table.starts[:-1], ended, side="right") - 1, 0)
        before = np.cumsum(table.counts) - table.counts
        return before[segment] + np.rint((ended - table.starts[segment]) / lengths[segment]).astype(np.int64)

    def _statistics(self) -> Statistics:
        """Of the batch; its steps and evaluations are those of one run to the end."""
        method, steps = self.setup.integrator, int(self.table.counts[:-1].sum())
        runs = f"compiled, {len(self.batch)} runs side by side"
        if self.again:
            runs += f", {len(self.again)} of them repeated with steps cut at thresholds"
        most = int(self.evaluations.max())
        return Statistics(method.name, self.setup.duration_s / steps, steps, most, 0.0, engine=runs)


def _starts(equation: StateEquation, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """The states at the starts of runs, (B, m)."""
    if equation.canonical or equation.equation_of_motion.drives:
        return np.stack([equation.start(*each) for each in zip(q, v, strict=True)])
    return np.column_stack([q, v, np.zeros((len(q), equation.size - 2 * q.shape[1]))])
