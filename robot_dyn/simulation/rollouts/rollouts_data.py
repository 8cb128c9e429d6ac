"""The fields of rollouts: those of `RunData` with a leading axis of runs, and the start, parameters and end of each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Annotated, Any, final

import numpy as np

from robot_dyn.foundations.coefficients import with_values
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.store import NOT_STORED, Layout
from robot_dyn.foundations.validate import integer
from robot_dyn.foundations.values import ReadOnly
from robot_dyn.simulation.diagnostics.runaway import step_too_long
from robot_dyn.simulation.diagnostics.unstable_loop import explained, unstable
from robot_dyn.simulation.observation.observation import Observed
from robot_dyn.simulation.observation.remarks import Remark
from robot_dyn.simulation.results.run_data import SAMPLED, RunData
from robot_dyn.simulation.rollouts.comparison import Comparison
from robot_dyn.simulation.rollouts.parameters import parts_of_run
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
            self._judged[run] = _reason_of(setup, self.ends[run], *states_of(self, run, setup))
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


def _reason_of(setup: Setup, end: Outcome, t: np.ndarray, y: np.ndarray) -> Outcome:
    """Return the outcome of a run that diverged, with its step or its loop as the reason if that explains it.

    Only `simulate` searches for a stable period or stable gains, because that takes most of the time.
    """
    step_s = end.facts.get("step_s")  # to find it from the setup takes long if there are many ticks
    step = step_too_long(setup, end.t, None if step_s is None else float(step_s))
    loop = unstable(setup, t, y, runs_away=True, remedies=False, end=end.t)
    return explained(end, setup, chain(step, loop))  # the loop is linearised only if the step explains nothing


def states_of(runs: RolloutsData, run: int, setup: Setup) -> tuple[np.ndarray, np.ndarray]:
    """Return times (m,) and states (m, size) of a run; only the start if part of the state was not recorded."""
    equation = setup.equation
    if runs.q is None or runs.v is None or equation.equation_of_motion.state_size:
        return np.zeros(1), equation.start(setup.q0, setup.v0)[None]
    rest = np.zeros((len(runs.t), equation.size - 2 * len(setup.q0)))
    return runs.t, np.hstack([runs.q[run], runs.v[run], rest])
