"""The fields of rollouts: those of `RunData` with a leading axis of runs, and the start, parameters and end of each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, final

import numpy as np

from robot_dyn.foundations.coefficients import with_values
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.store import NOT_STORED, Layout
from robot_dyn.foundations.validate import integer
from robot_dyn.foundations.values import ReadOnly
from robot_dyn.simulation.observation.observation import Observed
from robot_dyn.simulation.observation.remarks import Remark
from robot_dyn.simulation.results.run_data import SAMPLED, RunData
from robot_dyn.simulation.rollouts.comparison import Comparison
from robot_dyn.simulation.rollouts.parameters import parts_of_run
from robot_dyn.simulation.rollouts.reasons import Samples, reason_of
from robot_dyn.simulation.run.outcome import Ending, Outcome
from robot_dyn.simulation.setup.setup import Setup


@final
@dataclass(frozen=True, eq=False)
class Overview(ReadOnly):
    """The overview of a batch.

    Attributes:
        worst, remarks, rms_tracking_error: See `Rollouts`.
    """

    worst: int
    remarks: tuple[Remark, ...]
    rms_tracking_error: Annotated[np.ndarray, Layout(("B",))] | None


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RolloutsData(RunData):
    """The fields of B runs; see `Rollouts`."""

    q: Annotated[np.ndarray, SAMPLED["q"].of_runs] | None
    v: Annotated[np.ndarray, SAMPLED["v"].of_runs] | None
    u: Annotated[np.ndarray, SAMPLED["u"].of_runs] | None
    kinetic: Annotated[np.ndarray, SAMPLED["kinetic"].of_runs] | None
    potential: Annotated[np.ndarray, SAMPLED["potential"].of_runs] | None
    work: dict[str, Annotated[np.ndarray, SAMPLED["work"].of_runs]] | None
    ends: tuple[Outcome, ...]
    steps: Annotated[np.ndarray, Layout(("B",), "int64")]
    evaluations: Annotated[np.ndarray, Layout(("B",), "int64")]
    sources: tuple[str, ...]
    varied: dict[str, Annotated[np.ndarray, Layout(("B", None))]]
    q0: Annotated[np.ndarray, Layout(("B", "n"))]
    v0: Annotated[np.ndarray, Layout(("B", "n"))]
    observed: Observed
    setup: Annotated[Setup | None, NOT_STORED] = None
    uncut: tuple[str, ...] = ()
    comparison: Comparison | None = None
    saved: Overview | None = None
    numbers: Annotated[np.ndarray | None, NOT_STORED] = None

    def __len__(self) -> int:
        return len(self.ends)

    @cached_property
    def ended_s(self) -> np.ndarray:
        """Time at which each run ended, (B,), in [s]."""
        return np.array([end.t for end in self.ends])

    @cached_property
    def diverged(self) -> np.ndarray:
        """True for runs that diverged, (B,)."""
        return self._ended_by(Ending.DIVERGED)

    @cached_property
    def stopped(self) -> np.ndarray:
        """True for runs that were interrupted, (B,)."""
        return self._ended_by(Ending.STOPPED)

    def _ended_by(self, ending: Ending) -> np.ndarray:
        return np.array([end.ending is ending for end in self.ends])

    def outcome(self, run: int) -> Outcome:
        """Return the outcome of a run; raises QueryError if no run has that number."""
        return self._outcome(integer("run", run, least=-len(self), most=len(self) - 1) % len(self))

    @property
    def outcomes(self) -> tuple[Outcome, ...]:
        """Outcomes of the B runs, same as in `simulate`; a run that diverged is judged on first access."""
        return tuple(map(self._outcome, range(len(self))))

    def _outcome(self, run: int) -> Outcome:
        if self.setup is None or self.ends[run].ending is not Ending.DIVERGED:
            return self.ends[run]
        if run not in self._judged:
            setup = with_values(self.setup, self._of_run(self.setup, run))  # checked before the run
            self._judged[run] = reason_of(setup, self.ends[run], samples_of(self, run))
        return self._judged[run]

    @cached_property
    def _judged(self) -> dict[int, Outcome]:
        """Outcomes of runs that diverged, by run, as far as they were accessed."""
        return {}

    def setup_of(self, run: int) -> Setup:
        """Return the setup of a single run: `rd.simulate(runs.setup_of(17))` repeats the run with an error estimate.

        Raises:
            QueryError: If no run has that number, or the runs were read from a file.
        """
        setup = self.setup
        if setup is None:
            raise QueryError("runs that were read from a file have no setup; run rd.rollouts again, and use its result")
        run = integer("run", run, least=-len(self), most=len(self) - 1) % len(self)
        return replace(setup, estimate_error=True, **self._of_run(setup, run))

    def _of_run(self, setup: Setup, run: int) -> dict[str, Any]:
        """Return the attributes of the setup of a run: its start, and its parts with its parameters and noise."""
        number = run if self.numbers is None else int(self.numbers[run])
        plant, controller = parts_of_run(setup, {name: x[run] for name, x in self.varied.items()}, number)
        return {"plant": plant, "controller": controller, "q0": self.q0[run], "v0": self.v0[run]}


def samples_of(runs: RolloutsData, run: int) -> Samples:
    """Return times, positions and velocities of one run of a batch."""
    return runs.t, None if runs.q is None else runs.q[run], None if runs.v is None else runs.v[run]
