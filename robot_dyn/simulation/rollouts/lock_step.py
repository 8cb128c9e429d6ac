"""A batch of runs in tiles of 64 in lock step, one thread for each tile.

Records are arrays over time, row and run, in this order, so that a tile writes whole vectors. If `simulate` cuts
steps at thresholds, the runs that may pass one are repeated one by one, and replace the runs of lock step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import cast, final

import numpy as np

from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.arithmetic import FLOAT64
from robot_dyn.foundations.coefficients import with_values
from robot_dyn.foundations.values import cached
from robot_dyn.integrate.integrator import PlainMethod
from robot_dyn.model.right_angles import robot_of
from robot_dyn.simulation.compiled.cache import machine_code
from robot_dyn.simulation.compiled.choice import checked
from robot_dyn.simulation.compiled.machine_code import MachineCode
from robot_dyn.simulation.diagnostics.runaway import speed_limits
from robot_dyn.simulation.dynamics.loop_state import Ended, LaneEnd, lanes_of, loop_config, start_position
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.events.detection import DetectingWork
from robot_dyn.simulation.observation.observation import observations_of, observed
from robot_dyn.simulation.results.statistics import Statistics
from robot_dyn.simulation.rollouts.batch import Batch, Record, Single
from robot_dyn.simulation.rollouts.one_by_one import singles
from robot_dyn.simulation.rollouts.pool import in_threads
from robot_dyn.simulation.rollouts.thresholds import Thresholds
from robot_dyn.simulation.run.fixed_steps import samples_at_most
from robot_dyn.simulation.run.outcome import Outcome, Reason
from robot_dyn.simulation.run.recording import Loop, records_of
from robot_dyn.simulation.run.watch import LARGEST, step_and_period
from robot_dyn.simulation.setup.schedule import ON_STEP
from robot_dyn.simulation.setup.segment_table import segment_table
from robot_dyn.simulation.setup.setup import Setup

LANES = 64  # runs in a tile: with 8, 16 or 32 a step of RK4 took 1.5, 1.1 and 1.05 times as long
_REASONS = {
    LaneEnd.OVERFLOW: Reason.STATE_OVERFLOWS,
    LaneEnd.ENERGY_GAIN: Reason.ENERGY_WITHOUT_SOURCE,
    LaneEnd.NO_STAGES: Reason.STAGES_NOT_FOUND,
}
_INSTANTS = 200  # least number of instants at which an actuation that changes between ticks is observed


def lanes_code(batch: Batch, detects: bool = False) -> MachineCode:
    """Return the machine code of runs in lock step, checked; see `machine_code` for `detects`."""
    setup, options = batch.setup, {"extras": batch.extras, "swept": tuple(batch.sweep), "detects": detects}
    return checked(setup, partial(machine_code, setup.equation, setup.method, lanes=LANES, **options))


@final
class Tiles:
    """The tiles of a batch and their record: time by row by run, so that a tile writes whole vectors.

    Args:
        batch: The runs.
        code: Machine code of their state equation, with the extras of the batch.
        thresholds: Thresholds at which steps are cut; None without any, or if cuts are not requested.
    """

    def __init__(self, batch: Batch, code: MachineCode, thresholds: Thresholds | None = None) -> None:
        setup, equation, n = batch.setup, code.compiled_form, code.compiled_form.plant.dynamics.n
        self.batch, self.setup, self.code, self.thresholds = batch, setup, code, thresholds
        self.y = starts(equation, batch.q0, batch.v0)
        self.levels = batch.levels(equation.plant, equation.controller)
        places = {
            "q": range(n),
            "v": range(n, 2 * n),
            "work": range(equation.size - len(equation.sources), equation.size),
        }
        self.states = [name for name in places if name in batch.recorded and name not in batch.extras]
        self.rows = np.array([row for name in self.states for row in places[name]], np.int64)
        tiles = -(-len(batch) // LANES)
        width = tiles * LANES
        self.numbers = np.minimum(np.arange(width), len(batch) - 1)  # a tile that is not full repeats a run
        self.table, self.apart = segment_table(setup), 0
        self.steps = int(self.table.counts[:-1].sum())
        if "actuation" in code.code.programs:
            self.apart = 1 if equation.sampled else max(1, self.steps // _INSTANTS)
        most, more = samples_at_most(setup, self.table.counts), sum(batch.sizes[name] for name in batch.extras)
        self.out_y, self.out_extras = np.empty((most, len(self.rows), width)), np.empty((most, more, width))
        q0, v0 = batch.q0[self.numbers].T, batch.v0[self.numbers].T
        start = np.vstack([q0, v0, np.full((n, width), np.nan)])
        self.observations = observations_of(start, self.levels.of_runs(self.numbers), tiles)
        self.t = [np.zeros(0)] * tiles  # times of the samples of each tile, in [s]
        self.unfinished = np.ones(tiles, dtype=bool)
        self.why, self.last = np.zeros(width, np.int64), np.zeros((equation.size, width))
        self.ended, self.until = np.full(width, setup.duration_s), np.full(width, np.inf)
        self.positions = [start_position() for _ in range(tiles)]
        self.evaluations, self.stop = np.zeros(tiles, np.int64), np.zeros(1, np.int64)
        self.one_by_one_s = 0.0

    def run(self, threads: int, on_progress: Callable[[float], object] | None = None) -> Record:
        """Run all tiles, one thread for each; Ctrl-C or an error of `on_progress` ends them at their next step."""
        began, end, reached = perf_counter(), self.setup.duration_s, 0.0

        def report(t: float) -> None:
            nonlocal reached
            reached = max(reached, t)
            if on_progress is not None:
                on_progress(reached)

        in_threads(self._tile, len(self.t), threads, self.stop, lambda: report(self._reached()))
        result = self._record(self._repeated(threads, report), began)
        if on_progress is not None and all(x.reason is not Reason.INTERRUPTED for x in result.outcomes):
            report(end)
        return result

    def _reached(self) -> float:
        """Return the mean time reached, in [s], of the runs that need no repetition."""
        end, left = self.setup.duration_s, np.isinf(self.until).reshape(-1, LANES).mean(axis=1)
        next_samples = np.array([position.sample_time[0] for position in self.positions])
        return float((left * np.where(self.unfinished, np.minimum(next_samples, end), end)).mean())

    def _repeated(self, threads: int, report: Callable[[float], object]) -> dict[int, Single | None]:
        """Repeat separately the runs that lock step cannot judge; None for a run that did not start before Ctrl-C.

        With cuts, these runs may have passed a threshold or diverged. Runs that finished at an implausible speed are
        repeated too: `simulate` judges them by their energy ledger, which is not recorded here.
        """
        B, end, whole = len(self.batch), self.setup.duration_s, self.batch.thresholds
        passed = (np.isfinite(self.until) | (self.why > 0)) & (self.thresholds is not None)
        as_simulated = self.thresholds is not None or whole is None or not whole.some.any()
        runs = np.flatnonzero((passed | (self._implausible() & as_simulated))[:B])
        records: list[Single | None] = [None] * len(runs)
        if len(runs) and not self.stop[0]:
            part, began = len(runs) / B, perf_counter()
            levels = self.levels.of_runs(runs)
            records, _ = singles(self.batch.some(runs), levels, threads, lambda t: report((1 - part) * end + part * t))
            self.one_by_one_s = perf_counter() - began
        return dict(zip(runs.tolist(), records, strict=True))

    def _implausible(self) -> np.ndarray:
        """Return True for runs that finished with a joint above its speed limit, (tiles · LANES,)."""
        n = self.setup.plant.dynamics.n
        low, high = (
            np.hstack([getattr(tile, side)[n : 2 * n] for tile in self.observations]) for side in ("low", "high")
        )
        fast = (np.maximum(-low, high) > cached(self.setup, speed_limits)[:, None]).any(axis=0)
        return fast & (self.why == 0) & ~np.repeat(self.unfinished, LANES)

    def _tile(self, tile: int) -> None:
        equation, n = self.code.compiled_form, self.setup.plant.dynamics.n
        lanes = slice(tile * LANES, (tile + 1) * LANES)
        numbers = self.numbers[lanes]
        run_parameters = self.code.run_parameters({name: x[numbers] for name, x in self.batch.sweep.items()})
        noise, more = self.batch.number_of(numbers), self.out_extras.shape[1]
        runs = lanes_of(equation, self.y[numbers].T, run_parameters, more, self.table.parameters[0], noise)
        method = cast(PlainMethod, self.setup.method)
        assert self.code.machine_loop is not None
        advance = self.code.machine_loop.calls()
        rows = equation.size | 1  # odd: stages a power of two apart would share the sets of a cache
        stepper = method.stepper(FLOAT64, equation.size, n, rows, LANES)
        position = self.positions[tile]
        position.budget[0] = np.iinfo(np.int64).max
        arrays = self.rows, self.out_y, self.out_extras
        records = records_of((equation.size, n), *arrays, observation=self.observations[tile])
        config = loop_config(equation, alone=False)._replace(
            largest=LARGEST,
            base=lanes.start,
            apart=self.apart,
            sample_period=float(self.setup.record_every_s or 0.0),
            sample_slack=ON_STEP * self.setup.nominal_step_s,
        )
        work = stepper.work
        if self.thresholds is not None:
            positions = 0 if equation.canonical else n
            events = self.thresholds.lanes(numbers, equation.size, positions)
            self.until[lanes] = events.until
            work = DetectingWork(work, work.K, events._replace(until=self.until[lanes]))
        loop = Loop(self.table, runs, records, config, position)
        ended = advance(self.code.code.addresses, stepper.coefficients, work, loop, self.stop)
        self.unfinished[tile], self.evaluations[tile] = ended != Ended.DONE, position.evaluations[0]
        rows = int(position.sample_row[0])
        self.t[tile] = records.t[:rows]
        self.why[lanes], self.last[:, lanes] = runs.reason, runs.end_state
        self.ended[lanes] = np.where(runs.reason > 0, runs.end_time, self.setup.duration_s)
        if ended != Ended.DONE:
            s = int(position.segment[0])
            reached = self.table.starts[s] + position.step[0] * self.table.lengths[s]
            self.ended[lanes] = np.where(runs.reason > 0, runs.end_time, reached)
            for array in (self.out_y, self.out_extras):
                array[rows:, :, lanes] = np.nan

    def _record(self, repeated: dict[int, Single | None], began: float) -> Record:
        """Return the record of lock step, in which repeated runs replace those that passed a threshold."""
        B, setup, t = len(self.batch), self.setup, max(self.t, key=len)
        why, ended = self.why[:B], self.ended[:B].copy()
        outcomes = [Outcome(Reason.END, setup.duration_s)] * B
        for run in np.flatnonzero(np.repeat(self.unfinished, LANES)[:B]).tolist():
            outcomes[run] = Outcome(Reason.INTERRUPTED, float(ended[run]))
        for run in np.flatnonzero(why).tolist():
            fastest = self.code.compiled_form.fastest_joint(self.last[:, run])
            outcomes[run] = Outcome(_REASONS[LaneEnd(why[run])], float(ended[run]), fastest, step_and_period(setup))
        columns, sizes = dict[str, np.ndarray](), self.batch.sizes
        for array, names in ((self.out_y, self.states), (self.out_extras, self.batch.extras)):
            by_run = np.moveaxis(array[: len(t), :, :B], -1, 0)
            parts = np.split(by_run, np.cumsum([sizes[name] for name in names]), axis=-1)
            columns |= dict(zip(names, parts, strict=False))
        label = f"compiled, {B} runs side by side"
        if cut := sum(bool(np.isfinite(self.until[run]) or why[run]) for run in repeated):
            label += f", {cut} of them repeated with steps cut at thresholds"
        step, most = setup.duration_s / self.steps, int(self.evaluations.max())
        alone = {run: single.observation for run, single in repeated.items() if single is not None}
        instants = self.steps // self.apart if self.apart > 1 else 0
        result = Record(
            _compiled(setup), t, columns, outcomes, self._steps(ended), np.repeat(self.evaluations, LANES)[:B],
            Statistics(setup.method.name, step, self.steps, most, perf_counter() - began, engine=label,
                       one_by_one=len(alone), one_by_one_s=self.one_by_one_s),
            observed(self.observations, self.levels, alone, instants)[:B],
        )  # fmt: skip
        for run, single in repeated.items():
            if single is not None:
                result.write(run, single)
            elif np.isfinite(self.until[run]) or why[run]:
                rows = int(np.searchsorted(t, self.until[run], side="right"))
                result.cut(run, rows, Outcome(Reason.INTERRUPTED, float(min(self.until[run], ended[run]))))
        return result

    def _steps(self, ended: np.ndarray) -> np.ndarray:
        """Return the number of steps of each run up to its end."""
        table = self.table
        lengths = np.where(table.lengths > 0, table.lengths, 1.0)
        segment = np.maximum(np.searchsorted(table.starts[:-1], ended, side="right") - 1, 0)
        before = np.cumsum(table.counts) - table.counts
        return before[segment] + np.rint((ended - table.starts[segment]) / lengths[segment]).astype(np.int64)


def _compiled(setup: Setup) -> Setup:
    """Return the setup whose equations were compiled: right angles of the file are written out in full."""
    plant, controller = setup.plant, setup.controller
    if controller is not None:
        controller = with_values(controller, {name: robot_of(x) or x for name, x in controller.models.items()})
    plant = Plant(robot_of(plant.dynamics) or plant.dynamics, plant.effects)
    return replace(setup, plant=plant, controller=controller)


def starts(equation: StateEquation, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the states at the starts of runs, (B, m)."""
    if equation.canonical or equation.equation_of_motion.drives:
        return np.stack([equation.start(*start) for start in zip(q, v, strict=True)])
    return np.column_stack([q, v, np.zeros((len(q), equation.size - 2 * q.shape[1]))])
