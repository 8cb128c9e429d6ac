"""Runs of a batch made one after the other on each thread, each as `simulate` makes it: with its own steps and cuts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import NamedTuple, final

import numpy as np

from robot_dyn.codegen.parameters import over_runs, with_parameters
from robot_dyn.coefficients import with_values
from robot_dyn.simulation.compiled.build import with_numbers
from robot_dyn.simulation.compiled.compiled_state_equation import CompiledStateEquation
from robot_dyn.simulation.compiled.engine_choice import machine_of
from robot_dyn.simulation.diagnostics.step_remarks import observer_of
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.observation.guard_levels import GuardLevels, guard_levels
from robot_dyn.simulation.observation.observation import Observation, Observed, observation_of, observed
from robot_dyn.simulation.results.provenance import origin
from robot_dyn.simulation.results.samples import columns
from robot_dyn.simulation.results.trajectory import Statistics
from robot_dyn.simulation.rollouts.pool import in_threads
from robot_dyn.simulation.rollouts.result import Rollouts
from robot_dyn.simulation.run.make_run import make_run
from robot_dyn.simulation.run.outcome import Ending, Outcome
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.simulation.setup.size import check_batch


class Single(NamedTuple):
    """A run that was made by itself.

    Attributes:
        t: Of its samples, (k,), in [s].
        columns: What was recorded, (k, …) by name.
        outcome: How it ended.
        steps, evaluations: Their numbers.
        observation: What was observed of it.
    """

    t: np.ndarray
    columns: dict[str, np.ndarray]
    outcome: Outcome
    steps: int
    evaluations: int
    observation: Observation


@final
class OneByOne:
    """The runs and what they leave behind.

    Args:
        setup: Of all runs.
        q0, v0: Starts, (B, n).
        sweep: Values that differ from run to run, (B, size) by name.
        recorded: Names of what is kept.
        of: Their levels.
        numbers: Of the runs in their batch, of which their noise is; 0 to B − 1 unless given.
    """

    def __init__(
        self, setup: Setup, q0: np.ndarray, v0: np.ndarray, sweep: dict[str, np.ndarray], recorded: tuple[str, ...],
        of: GuardLevels, numbers: Sequence[int] | None = None,
    ) -> None:  # fmt: skip
        self.setup, self.q0, self.v0, self.sweep, self.recorded, self.levels = setup, q0, v0, sweep, recorded, of
        self.numbers = range(len(q0)) if numbers is None else numbers
        self.compiled = setup.engine != "interpreted"
        self.compiled_equation: CompiledStateEquation | None = None
        if self.compiled:
            whole = StateEquation(setup.plant, setup.controller, setup.integrator.canonical, setup.events)
            self.compiled_equation = machine_of(setup, whole, tuple(sweep))
            self.compiled_equation.check(setup)
        self.made: list[Single | None] = [None] * len(q0)
        self.stop = np.zeros(1, np.int64)

    def _of(self, run: int) -> tuple[Setup, StateEquation, CompiledStateEquation | None]:
        """The setup of a run, its state equation, and its machine code, which is that of all."""
        plant, controller = self.setup.plant, self.setup.controller
        if self.sweep:
            plant, controller = with_parameters(plant, controller, {name: x[run] for name, x in self.sweep.items()})
        if controller is not None:
            controller = controller.of_run(self.numbers[run])
        own = {"plant": plant, "controller": controller, "q0": self.q0[run], "v0": self.v0[run]}
        setup = with_values(self.setup, own)
        equation = StateEquation(plant, controller, setup.integrator.canonical, setup.events)
        if self.compiled_equation is None:
            return setup, equation, None
        if self.compiled_equation.equation.limited != equation.limited or setup.finds_events != self.setup.finds_events:
            return setup, equation, machine_of(setup, equation, tuple(self.sweep))
        return setup, equation, with_numbers(self.compiled_equation, equation.in_a_mode)  # only numbers differ

    def run(self, threads: int, on_progress: Callable[[float], object] | None = None) -> None:
        """All runs; Ctrl-C ends them, and an error of `on_progress`, which is told the mean of the times reached."""
        end = self.setup.duration_s

        def look() -> None:
            if on_progress is not None:
                on_progress(end * sum(each is not None for each in self.made) / len(self.made))

        in_threads(self._run, len(self.made), threads if self.compiled else 1, self.stop, look)
        if on_progress is not None and not self.stop[0]:
            on_progress(end)

    def _run(self, i: int) -> None:
        if self.stop[0]:
            return
        setup, equation, compiled_equation = self._of(i)
        observer = observer_of(setup, self.levels.of_runs([i]))
        run = make_run(setup, equation, compiled_equation, observer=observer)
        run.stop = self.stop
        self.made[i] = self._kept(equation, run.record(), observer.observation)

    def _kept(self, equation: StateEquation, record: Recording, observation: Observation) -> Single:
        """What is recorded of a run; not the sample at an event that ended it, which no other run has."""
        outcome = record.outcome
        early = outcome.ending is Ending.FINISHED and outcome.t < self.setup.duration_s
        rows = int(np.searchsorted(record.t, outcome.t)) if early else len(record.t)
        names: tuple[str, ...] = "q", "v", "a", "u", "work", "power", "energy"
        values: dict[str, np.ndarray] = dict(
            zip(names, columns(equation, record.t, record.y, record.made), strict=True)
        )
        kept = {name: values[name][:rows].copy() for name in self.recorded}
        return Single(record.t[:rows], kept, outcome, record.steps, record.evaluations, observation)


def one_by_one(
    setup: Setup, q0: np.ndarray, v0: np.ndarray, sweep: dict[str, np.ndarray], recorded: tuple[str, ...], most: int,
    threads: int, on_progress: Callable[[float], object] | None = None,
) -> Rollouts:  # fmt: skip
    """The rollouts of a setup, as of `OneByOne`; `most` is the number of bytes to record at most."""
    B, n, equation = len(q0), setup.plant.dynamics.n, StateEquation(setup.plant, setup.controller)
    sizes = {"q": n, "v": n, "u": n, "work": len(equation.sources), "energy": 2}
    check_batch(setup, B, sum(sizes[name] for name in recorded), most)
    of = guard_levels(setup.plant.dynamics, *over_runs(setup.plant, setup.controller, sweep), B)
    runs, began = OneByOne(setup, q0, v0, sweep, recorded, of), perf_counter()
    runs.run(threads, on_progress)
    t = max((each.t for each in runs.made if each is not None), key=len, default=np.zeros(1))
    kept = {name: np.full((B, len(t), sizes[name]), np.nan) for name in recorded}
    for i, each in enumerate(runs.made):
        start = {"q": q0[i : i + 1], "v": v0[i : i + 1]}  # of a run that was not begun
        for name, x in (start if each is None else each.columns).items():
            if name in kept:
                kept[name][i, : len(x)] = x
    outcomes = [Outcome(Ending.STOPPED, 0.0) if each is None else each.outcome for each in runs.made]
    steps = np.array([0 if each is None else each.steps for each in runs.made], np.int64)
    evaluations = np.array([0 if each is None else each.evaluations for each in runs.made], np.int64)
    engine = f"{'compiled' if runs.compiled else 'interpreted'}, {B} runs one after the other on each thread"
    step = 0.0 if setup.integrator.controls_error else setup.duration_s / setup.steps
    statistics = Statistics(
        setup.integrator.name, step, int(steps.max()), int(evaluations.max()), perf_counter() - began, engine=engine
    )
    ending = np.array([each.ending.value for each in outcomes])
    q, v, u = (kept.get(name) for name in ("q", "v", "u"))
    K, V = (kept["energy"][:, :, k] if "energy" in kept else None for k in (0, 1))
    work = {name: kept["work"][:, :, k] for k, name in enumerate(equation.sources)} if "work" in kept else None
    return Rollouts(
        setup.plant.dynamics.joint_names, t, q, v, u, K, V, work,
        np.array([each.t for each in outcomes]), ending == Ending.DIVERGED, ending == Ending.STOPPED,
        tuple(said(each) for each in outcomes), steps, evaluations, statistics, tuple(equation.sources),
        origin(setup.plant.dynamics) | setup.about, dict(sweep), setup, (), q0, v0, _observed(runs),
    )  # fmt: skip


def _observed(runs: OneByOne) -> Observed:
    """What was observed of all runs; of one that was not begun, its start."""
    starts = np.vstack([runs.q0.T, runs.v0.T, np.full_like(runs.q0.T, np.nan)])
    made = {i: each.observation for i, each in enumerate(runs.made) if each is not None}
    return observed([observation_of(starts, runs.levels)], runs.levels, made)


def said(outcome: Outcome) -> str:
    """What a batch keeps of the words of an outcome."""
    return "" if outcome.ending is Ending.STOPPED else outcome.advice
