"""A batch of runs by a method that chooses its steps: one after the other on each thread, since no two step alike."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from time import perf_counter
from typing import Any, final

import numpy as np

from robot_dyn.coefficients import with_values
from robot_dyn.compiled.parameters import with_parameters
from robot_dyn.simulation.event_run import EventRun
from robot_dyn.simulation.machine.machine import Machine
from robot_dyn.simulation.machine.making import machine
from robot_dyn.simulation.origin import origin
from robot_dyn.simulation.record import Record
from robot_dyn.simulation.rollout_result import Rollouts
from robot_dyn.simulation.samples import columns
from robot_dyn.simulation.setup import Setup
from robot_dyn.simulation.size import samples, too_large
from robot_dyn.simulation.state_equation import StateEquation
from robot_dyn.simulation.trajectory import Ending, Outcome, Statistics
from robot_dyn.simulation.transfers import Transfers
from robot_dyn.simulation.watch import Watch

_Q, _V, _U, _WORK, _ENERGY = 0, 1, 3, 4, 6  # of what `columns` gives


@final
class OneByOne:
    """The runs and what they leave behind.

    Args:
        setup: Of all runs.
        q0, v0: Starts, (B, n).
        sweep: Values that differ from run to run, (B, size) by name.
        recorded: Names of what is kept.
        most: Bytes of the record, at most.
    """

    def __init__(
        self, setup: Setup, q0: np.ndarray, v0: np.ndarray, sweep: dict[str, np.ndarray], recorded: tuple[str, ...],
        most: int,
    ) -> None:  # fmt: skip
        self.setup, self.q0, self.v0, self.sweep, self.recorded = setup, q0, v0, sweep, recorded
        self.equation, self.machine = self._of(0)
        self.machine.check(setup)
        size = 8 * samples(setup) * len(q0) * (2 * self.equation.size + setup.plant.dynamics.n + 2)
        if size > most:
            what = f"{samples(setup):.3g} samples of {len(q0)} runs"
            raise too_large(what, size, most, ", fewer runs, or record less")
        self.records: list[Record | None] = [None] * len(q0)
        self.going: set[EventRun] = set()
        self.stopped = False

    def _of(self, run: int) -> tuple[StateEquation, Machine]:
        """The state equation of a run and its machine code, which is that of all."""
        plant, controller = self.setup.plant, self.setup.controller
        if self.sweep:
            plant, controller = with_parameters(plant, controller, {name: x[run] for name, x in self.sweep.items()})
        if controller is not None:
            controller = controller.of_run(run)
        equation, method = StateEquation(plant, controller), self.setup.integrator
        code = machine(equation.in_a_mode, method, swept=tuple(self.sweep), jacobian=method.needs_jacobian, cuts=True)
        return equation, code

    def run(self, threads: int, on_progress: Callable[[float], object] | None = None) -> Rollouts:
        """All runs; Ctrl-C ends them, and an error of `on_progress`."""
        began, end = perf_counter(), self.setup.duration_s
        with ThreadPoolExecutor(threads, "robot_dyn") as pool:
            futures = [pool.submit(self._run, i) for i in range(len(self.q0))]
            try:
                while wait(futures, timeout=0.1).not_done:
                    if on_progress is not None:
                        on_progress(end * sum(each is not None for each in self.records) / len(self.records))
            except BaseException as error:
                self.stopped = True
                for each in list(self.going):
                    each.stop[0] = 1
                wait(futures)
                if not isinstance(error, KeyboardInterrupt):
                    raise
        for future in futures:
            future.result()
        if on_progress is not None and not self.stopped:
            on_progress(end)
        return self._result(perf_counter() - began)

    def _run(self, i: int) -> None:
        if self.stopped:
            return
        noisy = self.equation.controller is not None and self.equation.controller.deviates
        equation, code = self._of(i) if self.sweep or noisy else (self.equation, self.machine)
        setup = with_values(
            self.setup,
            {"plant": equation.plant, "controller": equation.controller, "q0": self.q0[i], "v0": self.v0[i]},
        )

        def made(of: StateEquation) -> tuple[Any, np.ndarray]:
            return code.equations.functions, code.parameters if of is equation else code.of(of)

        transfers = Transfers(equation)
        run = EventRun(
            Watch(setup, transfers.equation), transfers, made, None, code.advance(), in_python=code.in_python
        )
        self.going.add(run)
        try:
            self.records[i] = run.record()
        finally:
            self.going.discard(run)

    def _result(self, wall_s: float) -> Rollouts:
        B, n, equation = len(self.q0), self.setup.plant.dynamics.n, self.equation
        t = max((each.t for each in self.records if each is not None), key=len, default=np.zeros(1))
        kept = [np.full((B, len(t), k), np.nan) for k in (n, n, n, n, len(equation.sources), len(equation.sources), 2)]
        outcomes = []
        for i, record in enumerate(self.records):
            outcomes.append(Outcome(Ending.STOPPED, 0.0) if record is None else record.outcome)
            if record is not None:
                for array, x in zip(kept, columns(equation, record.t, record.y, record.made), strict=True):
                    array[i, : len(x)] = x
        asked = {name: name in self.recorded for name in ("q", "v", "u", "work", "energy")}
        work = {name: kept[_WORK][:, :, k] for k, name in enumerate(equation.sources)}
        steps, evaluations = (
            np.array([0 if each is None else getattr(each, name) for each in self.records], np.int64)
            for name in ("steps", "evaluations")
        )
        statistics = Statistics(
            self.setup.integrator.name, 0.0, int(steps.max()), int(evaluations.max()), wall_s,
            engine=f"compiled, {B} runs one after the other on each thread",
        )  # fmt: skip
        ending = np.array([each.ending.value for each in outcomes])
        advice = tuple(each.advice if each.ending is Ending.DIVERGED else "" for each in outcomes)
        K, V = (kept[_ENERGY][:, :, k] if asked["energy"] else None for k in (0, 1))
        return Rollouts(
            self.setup.plant.dynamics.joint_names, t, kept[_Q] if asked["q"] else None,
            kept[_V] if asked["v"] else None, kept[_U] if asked["u"] else None,
            K, V, work if asked["work"] else None, np.array([each.t for each in outcomes]), ending == Ending.DIVERGED,
            ending == Ending.STOPPED, advice, steps, evaluations, statistics, tuple(equation.sources),
            origin(self.setup.plant.dynamics) | self.setup.about,
            dict(self.sweep), self.setup,
        )  # fmt: skip
