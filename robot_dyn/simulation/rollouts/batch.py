"""A batch: a setup, with the starts and the values that differ from run to run; and the record of its runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, final

import numpy as np

from robot_dyn.codegen.parameters import over_runs
from robot_dyn.control.controller import Controller
from robot_dyn.effects.plant import Plant
from robot_dyn.simulation.observation.guard_levels import GuardLevels, guard_levels
from robot_dyn.simulation.observation.observation import Observation, Observed
from robot_dyn.simulation.results.statistics import Statistics
from robot_dyn.simulation.rollouts.parameters import parts_of_run
from robot_dyn.simulation.rollouts.thresholds import Thresholds, thresholds
from robot_dyn.simulation.run.outcome import Outcome
from robot_dyn.simulation.setup.setup import Setup


@final
@dataclass(frozen=True, eq=False)
class Batch:
    """B runs of a setup.

    Attributes:
        setup: Setup of all runs.
        q0, v0: Starts, (B, n).
        sweep: Values that differ from run to run, (B, size) by name.
        recorded: Names of the recorded quantities: "q", "v", "u", "energy", "work".
        numbers: Number of each run, which determines its noise, (B,); 0 to B − 1 unless given.
    """

    setup: Setup
    q0: np.ndarray
    v0: np.ndarray
    sweep: Mapping[str, np.ndarray] = field(default_factory=dict)
    recorded: tuple[str, ...] = ()
    numbers: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.q0)

    def some(self, runs: np.ndarray) -> Batch:
        """Return the batch of the runs at these places."""
        sweep = {name: x[runs] for name, x in self.sweep.items()}
        return Batch(self.setup, self.q0[runs], self.v0[runs], sweep, self.recorded, self.number_of(runs))

    def number_of(self, runs: np.ndarray) -> np.ndarray:
        """Return the numbers of the runs at these places."""
        return runs if self.numbers is None else self.numbers[runs]

    def parts(self, run: int) -> tuple[Plant, Controller | None]:
        """Return plant and controller of a run."""
        values = {name: x[run] for name, x in self.sweep.items()}
        return parts_of_run(self.setup, values, run if self.numbers is None else int(self.numbers[run]))

    def levels(self, plant: Plant, controller: Controller | None) -> GuardLevels:
        """Return the levels of all runs; values that differ replace those of `plant` and `controller`."""
        return guard_levels(plant.dynamics, *over_runs(plant, controller, self.sweep), len(self))

    @property
    def sizes(self) -> dict[str, int]:
        """Number of entries of each recorded quantity at a sample, by name."""
        n = self.setup.plant.dynamics.n
        sizes = {"q": n, "v": n, "u": n, "work": len(self.setup.equation.sources), "energy": 2}
        return {name: sizes[name] for name in self.recorded}

    @property
    def extras(self) -> tuple[str, ...]:
        """Recorded quantities beyond the state, which machine code computes at samples."""
        extras = ("u", "v", "energy") if self.setup.equation.canonical else ("u", "energy")
        return tuple(name for name in extras if name in self.recorded)

    @property
    def why_one_by_one(self) -> str:
        """Reason why the runs are not in lock step; empty if they are."""
        setup, method = self.setup, self.setup.method
        motion = setup.plant.equation_of_motion
        if method.controls_error:
            return f"{method.name} chooses its steps"
        if setup.engine == "interpreted":
            return "the engine is interpreted"
        if motion.set_valued and not method.nonsmooth:
            return f"{motion.set_valued[0].name} stops and releases joints, where steps must end"
        if motion.payloads:
            return f"{motion.payloads[0].name} is attached and detached, where steps must end"
        return "steps end at events" if setup.events else ""

    @cached_property
    def thresholds(self) -> Thresholds | None:
        """Thresholds at which `simulate` would cut the steps of runs in lock step; None without any."""
        return None if self.why_one_by_one else thresholds(self.setup, self.sweep, len(self))


class Single(NamedTuple):
    """The record of one run.

    Attributes:
        t: Times of its samples, (k,), in [s].
        columns: Recorded quantities, (k, …) by name.
        outcome: Outcome of the run.
        steps, evaluations: Number of steps and of evaluations of the equation of motion.
        observation: Observations of all steps.
    """

    t: np.ndarray
    columns: dict[str, np.ndarray]
    outcome: Outcome
    steps: int
    evaluations: int
    observation: Observation


@final
@dataclass(eq=False)
class Record:
    """The record of a batch and the outcomes of its runs; both ways of running write into its arrays.

    Attributes:
        setup: Setup whose equations ran.
        t: Times of the samples, (m,), in [s].
        columns: Recorded quantities, (B, m, size) by name; nan after the end of a run.
        outcomes: Outcomes of the B runs.
        steps, evaluations: See `Rollouts`.
        statistics: Statistics of the batch.
        observed: Observations of all runs.
    """

    setup: Setup
    t: np.ndarray
    columns: dict[str, np.ndarray]
    outcomes: list[Outcome]
    steps: np.ndarray
    evaluations: np.ndarray
    statistics: Statistics
    observed: Observed

    def write(self, run: int, single: Single) -> None:
        """Write the record of a run."""
        self.cut(run, len(single.t), single.outcome)
        for name, x in self.columns.items():
            x[run, : len(single.t)] = single.columns[name]
        self.steps[run], self.evaluations[run] = single.steps, single.evaluations

    def cut(self, run: int, rows: int, outcome: Outcome) -> None:
        """End a run after some of its samples."""
        for x in self.columns.values():
            x[run, rows:] = np.nan
        self.outcomes[run] = outcome
