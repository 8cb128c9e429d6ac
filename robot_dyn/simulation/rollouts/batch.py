"""A batch: the starts and the values that differ from run to run, and the rollouts that its runs become."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, final

import numpy as np

from robot_dyn.codegen.parameters import over_runs
from robot_dyn.control.controller import Controller
from robot_dyn.effects.plant import Plant
from robot_dyn.simulation.observation.guard_levels import GuardLevels, guard_levels
from robot_dyn.simulation.observation.observation import Observed
from robot_dyn.simulation.results.provenance import origin
from robot_dyn.simulation.results.statistics import Statistics
from robot_dyn.simulation.rollouts.result import Rollouts
from robot_dyn.simulation.rollouts.sweepable import parts_of_run
from robot_dyn.simulation.run.outcome import Ending, Outcome
from robot_dyn.simulation.setup.setup import Setup, check_batch


class Ends(NamedTuple):
    """How the runs ended; attributes as of `Rollouts`."""

    ended: np.ndarray
    diverged: np.ndarray
    stopped: np.ndarray
    advice: tuple[str, ...]
    steps: np.ndarray
    evaluations: np.ndarray


@final
@dataclass(frozen=True, eq=False)
class Batch:
    """B runs of a setup.

    Attributes:
        setup: Of all runs.
        q0, v0: Starts, (B, n).
        sweep: Values that differ from run to run, (B, size) by name.
        recorded: Names of what is recorded: "q", "v", "u", "energy", "work".
        numbers: Of the runs, of which their noise is, (B,); 0 to B − 1 unless given.
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
        """The runs of these numbers."""
        sweep = {name: x[runs] for name, x in self.sweep.items()}
        return Batch(self.setup, self.q0[runs], self.v0[runs], sweep, self.recorded, self.number_of(runs))

    def number_of(self, runs: np.ndarray) -> np.ndarray:
        """Of runs at these places of the batch, the numbers of which their noise is."""
        return runs if self.numbers is None else self.numbers[runs]

    def parts(self, run: int) -> tuple[Plant, Controller | None]:
        """Plant and controller of a run."""
        values = {name: x[run] for name, x in self.sweep.items()}
        return parts_of_run(self.setup, values, run if self.numbers is None else int(self.numbers[run]))

    def levels(self, plant: Plant, controller: Controller | None) -> GuardLevels:
        """The levels of all runs, of a plant and a controller without their values."""
        return guard_levels(plant.dynamics, *over_runs(plant, controller, self.sweep), len(self))

    @property
    def sizes(self) -> dict[str, int]:
        """How many numbers of a sample are recorded, by name."""
        n = self.setup.plant.dynamics.n
        sizes = {"q": n, "v": n, "u": n, "work": len(self.setup.equation.sources), "energy": 2}
        return {name: sizes[name] for name in self.recorded}

    def check_size(self, most: int) -> None:
        """Raise a QueryError if its record takes more bytes than `most`."""
        check_batch(self.setup, len(self), sum(self.sizes.values()), most)

    def rollouts(
        self, setup: Setup, t: np.ndarray, columns: Mapping[str, np.ndarray], ends: Ends, statistics: Statistics,
        observed: Observed,
    ) -> Rollouts:  # fmt: skip
        """Return the result of the batch.

        Args:
            setup: Whose equations ran.
            t: Times of the samples, (m,).
            columns: What was recorded, (B, m, size) by name.
            ends: Of the runs.
            statistics: Of all.
            observed: Of the runs.
        """
        sources, energy, work = tuple(self.setup.equation.sources), columns.get("energy"), columns.get("work")
        K, V = (None, None) if energy is None else (energy[..., 0], energy[..., 1])
        return Rollouts(
            joint_names=self.setup.plant.dynamics.joint_names, t=t, q=columns.get("q"), v=columns.get("v"),
            u=columns.get("u"), kinetic=K, potential=V,
            work=None if work is None else dict(zip(sources, np.moveaxis(work, -1, 0), strict=True)),
            **ends._asdict(), statistics=statistics, sources=sources,
            about=origin(self.setup.plant.dynamics) | self.setup.about, params=dict(self.sweep), setup=setup,
            q0=self.q0, v0=self.v0, observed=observed, numbers=self.numbers,
        )  # fmt: skip


def advice_of(outcome: Outcome) -> str:
    """The advice of an outcome that a batch records."""
    return "" if outcome.ending is Ending.STOPPED else outcome.advice
