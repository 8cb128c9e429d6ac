"""The trajectories of a batch of rollouts: arrays over runs and samples, and an outcome for each run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from operator import index
from typing import Annotated, Any, final, overload

import numpy as np

from robot_dyn.errors import QueryError, escaped
from robot_dyn.simulation.observation.observation import Observed
from robot_dyn.simulation.observation.remarks import Remark
from robot_dyn.simulation.observation.remarks import lines as lines_of
from robot_dyn.simulation.results.summary import of_tracking
from robot_dyn.simulation.results.trajectory import Statistics, Trajectory
from robot_dyn.simulation.rollouts.overview import Overview, of_some, overview
from robot_dyn.simulation.run.outcome import Ending, Outcome
from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.validate import integer
from robot_dyn.values import NOT_STORED, Layout, Value, read_only

_SHARED = ("joint_names", "t", "statistics", "sources", "about", "setup", "uncut", "saved", "numbers")  # by all runs


@final
@dataclass(frozen=True, eq=False)
class Rollouts(Value):
    """B runs, m samples of each. Samples after the end of a run are nan. What was not recorded is None.

    `runs[i]` is the `Trajectory` of a run, `runs[i:j]` some of the runs, numbered from 0; both copy no samples. The
    state at an event that ends a run is not among its samples, which are at the same times in all runs.

    Attributes:
        joint_names: Of the n joints.
        t: In [s], (m,).
        q, v: In [rad] and [rad/s], or [m] and [m/s], (B, m, n).
        u: Actuation within its bounds, (B, m, n), in [N m] or [N].
        kinetic, potential: Energies, (B, m), in [J].
        work: Done up to each sample by the control and by each other effect, by name, (B, m), in [J].
        ended: When each run ended, (B,), in [s].
        diverged: Whether it diverged then, (B,).
        stopped: Whether it was interrupted, (B,).
        advice: Why a run diverged and what to do, or which event ended it, as of `simulate`; empty for the others.
        steps: Of each run, (B,).
        evaluations: Of the equation of motion, by the 64 runs that each was side by side with, (B,).
        statistics: Of the longest run; its time is that of all runs.
        sources: Names of what does work: the control and the effects without a potential.
        about: Texts, as of a `Trajectory`; of all runs, without `params`.
        params: Values that differ from run to run, by name, (B, n).
        setup: Of all runs; None for runs that were read from a file.
        uncut: Names of the thresholds at which steps do not end, with `cuts=False`.
        q0, v0: Starts, (B, n).
        observed: Extremes, limits passed and chatter of each run, over all steps but for u of continuous control, see
            `remarks`; None in files of older versions.
        saved: Of runs that were read from a file; None for others.
        numbers: Of a slice, the number of each run in the batch that was run, of which its noise is, (B,); None for
            all runs of a batch, and for runs that were read from a file.
    """

    joint_names: tuple[str, ...]
    t: Annotated[np.ndarray, Layout(("m",))]
    q: Annotated[np.ndarray, Layout(("B", "m", "n"))] | None
    v: Annotated[np.ndarray, Layout(("B", "m", "n"))] | None
    u: Annotated[np.ndarray, Layout(("B", "m", "n"))] | None
    kinetic: Annotated[np.ndarray, Layout(("B", "m"))] | None
    potential: Annotated[np.ndarray, Layout(("B", "m"))] | None
    work: dict[str, Annotated[np.ndarray, Layout(("B", "m"))]] | None
    ended: Annotated[np.ndarray, Layout(("B",))]
    diverged: Annotated[np.ndarray, Layout(("B",), "bool")]
    stopped: Annotated[np.ndarray, Layout(("B",), "bool")]
    advice: tuple[str, ...]
    steps: Annotated[np.ndarray, Layout(("B",), "int64")]
    evaluations: Annotated[np.ndarray, Layout(("B",), "int64")]
    statistics: Statistics
    sources: tuple[str, ...]
    about: dict[str, str]
    params: dict[str, Annotated[np.ndarray, Layout(("B", None))]]
    setup: Setup | None = field(default=None, metadata=NOT_STORED)
    uncut: tuple[str, ...] = ()
    q0: Annotated[np.ndarray, Layout(("B", "n"))] | None = None
    v0: Annotated[np.ndarray, Layout(("B", "n"))] | None = None
    observed: Observed | None = None
    saved: Overview | None = None
    numbers: np.ndarray | None = field(default=None, metadata=NOT_STORED)

    def __post_init__(self) -> None:
        read_only(self)

    def __len__(self) -> int:
        return len(self.ended)

    def __iter__(self) -> Iterator[Trajectory]:
        return (self[run] for run in range(len(self)))

    @overload
    def __getitem__(self, run: int) -> Trajectory: ...
    @overload
    def __getitem__(self, run: slice) -> Rollouts: ...

    def __getitem__(self, run: int | slice) -> Trajectory | Rollouts:
        """The trajectory of a run, counted from the end if negative; or the runs of a slice.

        Positions and velocities are those recorded. The rest is recorded, or follows from them and the setup: the
        acceleration, the powers and energies, and the torque of a continuous controller without an integral. What
        neither determines is nan: work that was not recorded; the torque of other controllers; and all but what was
        recorded of runs that were read from a file. It has no error estimate, and of the remarks of `simulate`
        those on limits, stops, chatter and the reference.

        Raises:
            QueryError: If q or v was not recorded, a slice has no runs, or `run` is neither a whole number nor a slice.
            IndexError: If there is no run of that number.
        """
        from robot_dyn.simulation.rollouts.run import trajectory

        if isinstance(run, slice):
            taken = range(len(self))[run]
            if not taken:
                raise QueryError(f"there is no run in {run}: runs are numbered from 0 to {len(self) - 1}")
            numbers = np.arange(len(self)) if self.numbers is None else self.numbers
            by_run = {name: _taken(x, run) for name, x in self._by_run().items()}
            some = replace(self, **by_run, numbers=numbers[run], saved=None)
            whole = None if self.saved is None else of_some(some, taken, self.saved)
            return replace(some, saved=whole)
        try:
            number = range(len(self))[index(None if isinstance(run, bool) else run)]  # type: ignore[arg-type]
        except TypeError:
            raise QueryError(f"runs are numbered: give a whole number or a slice, got {run!r}") from None
        except IndexError:
            raise IndexError(f"there is no run {run}: runs are numbered from 0 to {len(self) - 1}") from None
        return trajectory(self, number)

    def outcome(self, run: int) -> Outcome:
        """How a run ended; raises QueryError if there is no run of that number."""
        run = integer("run", run, least=-len(self), most=len(self) - 1)
        ended = float(self.ended[run])
        if self.stopped[run]:
            return Outcome(Ending.STOPPED, ended, "interrupted; all samples up to here are kept")
        if not self.diverged[run]:
            return Outcome(Ending.FINISHED, ended, self.advice[run])
        return Outcome(Ending.DIVERGED, ended, self.advice[run])

    def setup_of(self, run: int) -> Setup:
        """The setup of a run by itself: `rd.simulate(runs.setup_of(17))` repeats it, and estimates its error.

        Raises:
            QueryError: If there is no run of that number, or the runs were read from a file.
        """
        from robot_dyn.simulation.rollouts.run import setup_of

        if self.setup is None:
            raise QueryError("runs that were read from a file have no setup; run rd.rollouts again, and use its result")
        return setup_of(self, self.setup, integer("run", run, least=-len(self), most=len(self) - 1) % len(self))

    @cached_property
    def overview(self) -> Overview:
        """The overview of all runs."""
        return self.saved or overview(self)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """The remarks of `simulate` on each run: limits, stops, chatter and the reference, by kind, joint and quantity.

        `Remark.runs` are the numbers of the runs that it is about: first the worst, whose values and text it has, then
        the others in their order. A sampled loop is linearised in one run alone, `worst`. Under continuous control in
        lock step a limit of u that is passed between the instants of `Observed.instants` may be missed, and chatter is
        not looked for.
        """
        return self.overview.remarks

    @property
    def tracking_error(self) -> np.ndarray | None:
        """Of each run, as of a `Trajectory`, (B,); None without a reference, or if q was not recorded."""
        return self.overview.tracking_error

    @property
    def worst(self) -> int:
        """The run to look at first.

        The first to diverge; else that with the largest chatter; that farthest beyond a limit of the file, as a part of
        it; that with the largest tracking error; or 0.
        """
        return self.overview.worst

    def __repr__(self) -> str:
        return f"<Rollouts: {self.summary}>"

    def _repr_html_(self) -> str:
        from robot_dyn.simulation.rollouts.html import rollouts_html

        return rollouts_html(self)

    @property
    def summary(self) -> str:
        """How many runs, how many ended before their time and why; remarks; tracking error; which run to look at."""
        count = "1 run" if len(self) == 1 else f"{len(self)} runs"
        lines = [f"{count} of {len(self.t)} samples to t = {self.t[-1]:g} s; {self._early()}"]
        if self.uncut:
            levels = ", ".join(self.uncut)
            lines.append(f"cuts=False: no step ends at {levels}, and a run that passes one is not that of simulate")
        if self.diverged.any():
            run = int(self.diverged.argmax())
            lines.append(f"run {run} diverged at t = {self.ended[run]:g} s; {self.advice[run]}")
        counted = len(self) > 1
        remarks = [each if counted else replace(each, runs=()) for each in self.remarks]
        lines += lines_of(remarks) if self.observed is not None else ["between samples: not observed"]
        errors = self.tracking_error
        if errors is not None and np.isfinite(errors).any():
            most = int(np.nanargmax(errors))
            largest = f" in the median, {errors[most]:.3e} in run {most}" if counted else ""
            lines.append(f"{of_tracking(self, 'frame' in self.about)}: {np.nanmedian(errors):.3e} rms{largest}")
        again = "" if self.setup is None else f"; rd.simulate(runs.setup_of({self.worst})) repeats it by itself"
        lines.append(f"look at run {self.worst} first{again}")
        return "\n".join(escaped(line) for line in lines)

    def _early(self) -> str:
        """How many runs ended before their time, and why."""
        at = f" by an interrupt, the first at t = {self.ended[self.stopped].min():g} s" if self.stopped.any() else ""
        by_event = int((np.array([text != "" for text in self.advice]) & ~self.diverged).sum())
        early = f"{int(self.diverged.sum())} diverged, {int(self.stopped.sum())} stopped{at}"
        return early + (f", {by_event} ended by an event" if by_event else "")

    def _by_run(self) -> dict[str, Any]:
        return {each.name: getattr(self, each.name) for each in fields(self) if each.name not in _SHARED}


def _taken(values: Any, runs: slice) -> Any:
    """The same of some of the runs."""
    if isinstance(values, dict):
        return {name: x[runs] for name, x in values.items()}
    return None if values is None else values[runs]
