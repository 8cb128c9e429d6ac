"""Runs in lock step that advance by one period at a time: tiles of 64, whose states and inputs change in between.

The period is the duration of a setup. Each call runs the same segments from time 0, so nothing may depend on the time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from math import inf
from typing import cast, final

import numpy as np

from robot_dyn.codegen.threads import shared
from robot_dyn.foundations.arithmetic import FLOAT64
from robot_dyn.foundations.values import aligned
from robot_dyn.integrate.integrator import PlainMethod
from robot_dyn.simulation.dynamics.loop_state import LaneEnd, lanes_of, loop_config, start_position
from robot_dyn.simulation.rollouts.batch import Batch
from robot_dyn.simulation.rollouts.lock_step import LANES, lanes_code, starts
from robot_dyn.simulation.run.recording import Loop, records_of
from robot_dyn.simulation.run.watch import LARGEST
from robot_dyn.simulation.setup.segment_table import segment_table


@final
class Periods:
    """The tiles of a batch, their states, and one parameter that changes from period to period.

    Args:
        batch: The runs, with a setup of one period; their starts are not used.
        inputs: Name of the parameter that changes; the batch has it as a sweep.
        threads: Largest number of threads.

    Attributes:
        uses_time: True if the machine code depends on the time.
    """

    def __init__(self, batch: Batch, inputs: str, threads: int) -> None:
        setup = batch.setup
        code = lanes_code(batch)
        self._equation, self._count = code.compiled_form, len(batch)
        equation, n = self._equation, code.compiled_form.plant.dynamics.n
        programs = code.code.programs.values()
        self.uses_time = any(
            0 in (*program.outputs, *(x for op in program.ops for x in op.operands)) for program in programs
        )
        tiles = -(-len(batch) // LANES)
        controller = setup.controller  # noise is redrawn at each tick
        self._ticks = round(setup.duration_s / controller.period_s) if controller and controller.deviates else 0
        self._numbers = np.minimum(np.arange(tiles * LANES), len(batch) - 1)  # a tile that is not full repeats a run
        numbers = self._numbers.reshape(tiles, LANES)
        parameters = [code.run_parameters({name: x[row] for name, x in batch.sweep.items()}) for row in numbers]
        self._y, self._parameters = aligned((tiles, equation.size, LANES)), np.array(parameters)
        self._y[...] = np.nan
        self._reason = np.full((tiles, LANES), int(LaneEnd.OVERFLOW))
        swept = [x.name for x in code.inputs if x.name in batch.sweep]
        sizes = [batch.sweep[name].shape[1] for name in swept]
        first = n * equation.sampled + sum(sizes[: swept.index(inputs)])
        self._inputs = self._parameters[:, first : first + batch.sweep[inputs].shape[1]]
        table = segment_table(setup)
        table.ticks[-1] = 0  # the next period begins with this tick
        assert code.machine_loop is not None
        self._energy, self._p = code.in_python.energy, table.parameters[0]
        self._keys = np.zeros((tiles, 3, LANES), np.uint64)
        self._workers = []
        for _ in range(min(threads, tiles)):  # each thread has its own work arrays, and a call for every tile
            stepper = cast(PlainMethod, setup.method).stepper(FLOAT64, equation.size, n, equation.size | 1, LANES)
            lanes = lanes_of(equation, self._y[0], parameters[0], 0, self._p, np.zeros(LANES, np.uint64))
            empty = np.empty((0, 0, LANES))
            records = records_of((equation.size, n), np.zeros(0, np.int64), empty, empty)
            config = loop_config(equation, alone=False)._replace(largest=LARGEST)
            position, calls = start_position(inf), []
            for tile in range(tiles):
                self._keys[tile] = lanes.keys
                self._keys[tile, 1] += numbers[tile].astype(np.uint64)
                runs = lanes._replace(
                    y=self._y[tile], run_parameters=self._parameters[tile],
                    reason=self._reason[tile], keys=self._keys[tile],
                )  # fmt: skip
                arguments = code.code.addresses, stepper.coefficients, stepper.work
                loop = Loop(table, runs, records, config, position)
                calls.append(partial(code.machine_loop.calls(), *arguments, loop, np.zeros(1, np.int64)))
            counters = position.budget.base  # of all integer fields
            assert counters is not None
            position.budget[0] = np.iinfo(np.int64).max
            self._workers.append((counters, counters.copy(), calls))

    @property
    def work(self) -> int:
        """Number of entries of y that precede the works."""
        return self._equation.size - len(self._equation.sources)

    def start(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the states of runs that start at q and v (k, n), (k, m)."""
        return starts(self._equation, q, v)

    @property
    def ended(self) -> np.ndarray:
        """True for runs that have diverged, whose state is nan, (B,)."""
        return self._reason.ravel()[: self._count] > 0

    @property
    def y(self) -> np.ndarray:
        """States of all runs, (B, m): q, v, states of the controller and of effects, works in the latest period."""
        return self._y.transpose(0, 2, 1).copy().reshape(-1, self._equation.size)[: self._count]

    def write(self, runs: np.ndarray, y: np.ndarray, ended: np.ndarray) -> None:
        """Write states of some runs, (B,), from states y of all runs (B, m); `ended` is True for diverged runs."""
        lanes = np.flatnonzero(runs[self._numbers])
        tile, column, run = lanes // LANES, lanes % LANES, self._numbers[lanes]
        self._y[tile, :, column] = np.where(ended[run, None], np.nan, y[run])
        self._reason[tile, column] = np.where(ended[run], LaneEnd.OVERFLOW, LaneEnd.RUNNING)

    def energies(self) -> np.ndarray:
        """Return K + V of all runs, (B,), in [J]."""
        both = np.zeros((len(self._y), 2, LANES))
        for y, parameters, out in zip(self._y, self._parameters, both, strict=True):
            cast(Callable[..., None], self._energy)(0.0, y, self._p, parameters, out)
        return both.sum(axis=1).ravel()[: self._count]

    def advance(self, inputs: np.ndarray, periods: np.ndarray) -> None:
        """Advance all runs by a period.

        Args:
            inputs: Values of the parameter, (B, size).
            periods: Number of periods since the start of each run, which selects its noise, (B,).
        """
        if self._ticks:
            self._keys[:, 2] = (periods * self._ticks)[self._numbers].reshape(-1, LANES)
        rows = inputs if len(inputs) == len(self._numbers) else inputs[self._numbers]
        self._inputs[...] = rows.reshape(len(self._y), LANES, -1).transpose(0, 2, 1)
        self._y[:, self.work :] = 0.0
        left = iter(range(len(self._y)))  # a thread takes the next tile; calling next() on it is atomic
        shared(partial(self._run, left), len(self._workers), 1, len(self._workers))

    def _run(self, tiles: Iterator[int], first: int, last: int) -> int:
        for counters, start, calls in self._workers[first:last]:
            for tile in tiles:
                counters[...] = start
                calls[tile]()
        return 0
