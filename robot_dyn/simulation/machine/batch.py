"""A batch of runs in tiles of 64, each tile marched by one thread from beginning to end.

Records are arrays over time, row and run, in this order, so that a tile writes whole vectors.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace
from fractions import Fraction
from time import perf_counter
from typing import final

import numpy as np

from robot_dyn.effects.plant import Plant
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.simulation.machine.follow import follow
from robot_dyn.simulation.machine.machine import Machine
from robot_dyn.simulation.machine.making import machine
from robot_dyn.simulation.machine.parts import with_
from robot_dyn.simulation.machine.places import Ended, Lane, Now
from robot_dyn.simulation.machine.timetable import Timetable, timetable
from robot_dyn.simulation.machine.traced import robot_of
from robot_dyn.simulation.motion import Motion
from robot_dyn.simulation.origin import origin
from robot_dyn.simulation.rollout_result import Rollouts
from robot_dyn.simulation.setup import Setup
from robot_dyn.simulation.size import samples, too_large
from robot_dyn.simulation.trajectory import Ending, Statistics, diverged_advice

LANES = 64  # runs in a tile: with 8, 16 or 32 a step of RK4 took 1.5, 1.1 and 1.05 times as long
_REASONS = ("", "a number overflowed", "energy grows without a source", "the stages of a step are not found")
_FAR = 5e4  # [rad]: half the range of a tile's sine and cosine; such a run is done again by itself


@final
class Batch:
    """The tiles of a batch and what they record: time by row by run, so that a tile writes whole vectors."""

    def __init__(
        self, setup: Setup, nominal: Motion, made: Machine, q0: np.ndarray, v0: np.ndarray,
        free: dict[str, np.ndarray], wanted: tuple[str, ...], most: int,
    ) -> None:  # fmt: skip
        y = np.column_stack([q0, v0, np.zeros((len(q0), nominal.memory_size + len(nominal.sources)))])
        if nominal.canonical:
            y = np.stack([nominal.start(*each) for each in zip(q0, v0, strict=True)])
        self.setup, self.machine, self.y, self.wanted, self.values = setup, made, y, wanted, free
        self.nominal, self.q0, self.v0 = nominal, q0, v0
        self.free = np.column_stack([*free.values(), np.zeros((len(y), 0))])
        n, tiles = made.program.n, -(-len(y) // LANES)
        self.columns = [*range(n)] * ("q" in wanted)
        if "v" in wanted and not nominal.canonical:
            self.columns += range(n, 2 * n)
        if "work" in wanted:
            self.columns += range(2 * n + made.motion.memory_size, made.program.places.state)
        width = tiles * LANES
        counts = (len(self.columns), made.program.actuations, 2 * ("energy" in wanted))
        size = 8 * samples(setup) * width * sum(counts)
        if size > most:
            raise too_large(
                f"{samples(setup):.3g} samples of {len(y)} runs", size, most, ", fewer runs, or record less"
            )
        self.table = timetable(setup, end=True)
        self.rows = _samples(setup, self.table)
        m = len(self.rows)
        self.out_y = np.empty((m, counts[0], width))
        self.out_u = np.empty((m if counts[1] else 0, counts[1], width))
        self.out_e = np.empty((m if counts[2] else 0, 2, width))
        self.lanes, self.stop = np.zeros((tiles, len(Lane), LANES)), np.zeros(1, np.int64)
        self.lanes[:, Lane.ENDED] = setup.duration_s
        self.unfinished = np.ones(tiles, dtype=bool)
        self.clocks = np.tile([0.0, setup.record_period_s, 1e-9 * setup.step_s], (tiles, 1))
        self.evaluations, self.advice = np.zeros(tiles, np.int64), dict[int, str]()

    def run(self, threads: int, on_progress: Callable[[float], object] | None = None) -> Rollouts:
        """All tiles, each by one thread; Ctrl-C ends them at their next step, and an error of `on_progress`."""
        began = perf_counter()
        tiles, _ = iter(range(len(self.lanes))), self.machine.program.march  # compiled by this thread alone
        turn = threading.Lock()

        def work() -> None:
            while True:
                with turn:
                    tile = next(tiles, None)
                if tile is None:
                    return
                self._tile(tile)

        with ThreadPoolExecutor(min(threads, len(self.lanes)), "robot_dyn") as pool:
            futures = [pool.submit(work) for _ in range(min(threads, len(self.lanes)))]
            try:
                while wait(futures, timeout=0.1).not_done:
                    if on_progress is not None:
                        on_progress(self._reached())
            except BaseException as error:
                self.stop[0] = 1
                wait(futures)
                if not isinstance(error, KeyboardInterrupt):
                    raise
        for future in futures:
            future.result()
        result = self._result()
        if on_progress is not None and not result.stopped.any():
            on_progress(self.setup.duration_s)
        return replace(result, statistics=replace(result.statistics, wall_s=perf_counter() - began))

    def _reached(self) -> float:
        """The time reached, in [s], the mean over the tiles: that of the next sample of each."""
        return float(
            np.where(
                self.unfinished, np.minimum(self.clocks[:, 0], self.setup.duration_s), self.setup.duration_s
            ).mean()
        )

    def _tile(self, tile: int) -> None:
        program, table = self.machine.program, self.table
        places, own = program.places, slice(tile * LANES, (tile + 1) * LANES)
        index = np.minimum(np.arange(own.start, own.stop), len(self.y) - 1)  # a tile that is not full repeats a run
        work = np.zeros(places.size)
        work[: places.x] = self.y[index].T.ravel()
        work[places.x + (places.state + places.held) * LANES : places.k] = self.free[index].T.ravel()
        now = np.zeros(len(Now), dtype=np.int64)
        now[Now.BUDGET], now[Now.BASE], now[Now.FINAL] = np.iinfo(np.int64).max, own.start, 1
        steps = np.empty((len(self.rows), 2), np.int64)
        ended = self.machine.run(
            work, table, lanes=self.lanes[tile], alive=np.ones(LANES, np.int64), which=np.array(self.columns, np.int64),
            out_step=steps, out_y=self.out_y, out_u=self.out_u, out_e=self.out_e, now=now, clock=self.clocks[tile],
            stop=self.stop,
        )  # fmt: skip
        self.unfinished[tile], self.evaluations[tile] = ended is not Ended.DONE, now[Now.EVALUATIONS]
        if ended is not Ended.DONE:
            going = self.lanes[tile, Lane.REASON] == 0
            self.lanes[tile, Lane.ENDED, going] = table.time(int(now[Now.STRETCH]), int(now[Now.STEP]))
            for array in (self.out_y, self.out_u, self.out_e):
                array[int(now[Now.ROW]) :, :, own] = np.nan

    def _result(self) -> Rollouts:
        B, n, motion = len(self.y), self.machine.program.n, self.machine.motion
        t = self.table.starts[self.rows[:, 0]] + self.rows[:, 1] * self.table.lengths[self.rows[:, 0]]
        lanes = np.moveaxis(self.lanes, 1, 0).reshape(len(Lane), -1)[:, :B]
        stopped = np.repeat(self.unfinished, LANES)[:B] & (lanes[Lane.REASON] == 0)
        for run in np.flatnonzero((lanes[Lane.FASTEST] > _FAR) & (lanes[Lane.REASON] == 0) & ~stopped):
            stopped[run] = self.stop[0] != 0 or self._again(int(run)) is Ending.STOPPED
            self.stop[0] |= stopped[run]

        def part(name: str, first: int, count: int) -> np.ndarray | None:
            return np.moveaxis(self.out_y[:, first : first + count, :B], -1, 0) if name in self.wanted else None

        at, beside = n * ("q" in self.wanted), np.moveaxis(self.out_u[:, :, :B], -1, 0)
        v = beside[:, :, n:] if motion.canonical and "v" in self.wanted else part("v", at, n)
        work = part("work", len(self.columns) - len(motion.sources), len(motion.sources))
        tau = beside[:, :, :n] if "tau" in self.wanted else None
        K, V = (self.out_e[:, i, :B].T if "energy" in self.wanted else None for i in range(2))
        works = None if work is None else {name: work[..., i] for i, name in enumerate(motion.sources)}
        ended, reasons = lanes[Lane.ENDED].copy(), lanes[Lane.REASON].astype(int)
        return Rollouts(
            motion.plant.dynamics.joint_names, t, part("q", 0, n), v, tau, K, V, works,
            ended, reasons > 0, stopped, self._advice(reasons, lanes[Lane.JOINT].astype(int)),
            self._steps(ended), np.repeat(self.evaluations, LANES)[:B], self._statistics(), tuple(motion.sources),
            origin(self.setup.plant.dynamics) | self.setup.about, dict(self.values), self._compiled(),
        )  # fmt: skip

    def _compiled(self) -> Setup:
        """The setup whose equations were compiled: right angles of the file written out in full."""
        plant, controller = self.setup.plant, self.setup.controller
        if (model := robot_of(getattr(controller, "model", None))) is not None:
            controller = with_(controller, {"model": model})
        plant = Plant(robot_of(plant.dynamics) or plant.dynamics, plant.effects)
        return replace(self.setup, plant=plant, controller=controller)

    def _advice(self, reasons: np.ndarray, fastest: np.ndarray) -> tuple[str, ...]:
        """Why runs diverged and what to do; nothing for the others."""
        advice, names = [""] * len(reasons), self.machine.motion.plant.dynamics.joint_names
        for run in np.flatnonzero(reasons).tolist():
            made = diverged_advice(_REASONS[reasons[run]], names[fastest[run]], self.setup.taken_step_s)
            advice[run] = self.advice.get(run, made)
        return tuple(advice)

    def _steps(self, ended: np.ndarray) -> np.ndarray:
        """Number of steps of each run up to its end."""
        table = self.table
        stretch = np.maximum(np.searchsorted(table.starts[:-1], ended, side="right") - 1, 0)
        before = np.cumsum(table.counts) - table.counts
        return before[stretch] + np.rint((ended - table.starts[stretch]) / table.lengths[stretch]).astype(np.int64)

    def _statistics(self) -> Statistics:
        """Of the batch; its steps and evaluations are those of one run to the end."""
        method, steps = self.setup.integrator, int(self.table.counts[:-1].sum())
        assert isinstance(method, Integrator)
        runs = f"compiled, {len(self.y)} runs side by side"
        return Statistics(
            method.name, self.setup.duration_s / steps, steps, int(self.evaluations.max()), 0.0, engine=runs
        )

    def _again(self, run: int) -> Ending:
        """A run that turned beyond the range of a tile's sine, by itself, in the march of one state; how it ended."""
        n = self.machine.program.n
        setup = replace(self.setup, q0=self.q0[run], v0=self.v0[run])
        assert isinstance(setup.integrator, Integrator)
        free = {name: x[run] for name, x in self.values.items()}
        one = machine(self.nominal, setup.integrator, free=free)
        record = follow(setup, one.motion, one, Fraction(1), 1)
        k, made, energy = len(record.t), *one.look(record.t, np.ascontiguousarray(record.y), record.held)
        for array in (self.out_y, self.out_u, self.out_e):
            array[:, :, run] = np.nan
        self.out_y[:k, :, run] = record.y[:, self.columns]
        if len(self.out_u):
            both = np.column_stack([made[:, -n:], made[:, :n]])  # u, and v if that is asked for in its own place
            self.out_u[:k, :, run] = both[:, : self.out_u.shape[1]]
        if len(self.out_e):
            self.out_e[:k, :, run] = energy
        tile, lane = divmod(run, LANES)
        self.lanes[tile, Lane.ENDED, lane] = record.outcome.t
        self.lanes[tile, Lane.REASON, lane] = record.outcome.ending is Ending.DIVERGED
        self.advice[run] = record.outcome.advice
        return record.outcome.ending


def _samples(setup: Setup, table: Timetable) -> np.ndarray:
    """Stretch and step of each sample, (m, 2), by the rule of `collect`; the last is the end.

    At most as long as what is recorded: a long run of few samples has more steps than memory holds.
    """
    before, total = np.cumsum(table.counts) - table.counts, int(table.counts.sum())
    period = setup.record_period_s
    if not period:
        at = np.arange(total)
    else:
        count = min(total, int(setup.duration_s / period) + 2)
        due = np.cumsum(np.append(0.0, np.full(count, period))) - 1e-9 * setup.step_s  # as the march adds it up
        stretch = np.maximum(np.searchsorted(table.starts, due, side="right") - 1, 0)
        start, length = table.starts[stretch], table.lengths[stretch]
        step = np.maximum(np.floor((due - start) / np.where(length > 0, length, 1.0)) - 1, 0)
        for _ in range(3):  # the first step that is not before its time, whatever the quotient rounds to
            step += start + step * length < due
        number = np.arange(count + 1)
        at = np.maximum.accumulate((before[stretch] + step).astype(np.int64) - number) + number
        at = np.append(at[at < total - 1], total - 1)
    stretch = np.searchsorted(before, at, side="right") - 1
    return np.column_stack([stretch, at - before[stretch]])
