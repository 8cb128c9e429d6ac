"""The trajectories of a batch of rollouts: arrays over runs and samples, and an outcome for each run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, replace
from functools import cached_property
from operator import index
from pathlib import Path
from typing import Any, final, overload

import numpy as np

from robot_dyn.foundations.display import MAX_JOINTS, curves, page, plot, text
from robot_dyn.foundations.errors import QueryError, escaped
from robot_dyn.queries.units import unit
from robot_dyn.simulation.columns import Column, Variable
from robot_dyn.simulation.observation.remarks import Remark
from robot_dyn.simulation.observation.remarks import remark_lines as lines_of
from robot_dyn.simulation.results.formats.save import save_data
from robot_dyn.simulation.results.provenance import about_the_robot, joint_types
from robot_dyn.simulation.results.run_data import taken
from robot_dyn.simulation.results.summary import of_tracking
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.simulation.rollouts.overview import of_some, overview
from robot_dyn.simulation.rollouts.rollouts_data import Overview, RolloutsData
from robot_dyn.simulation.rollouts.run import trajectory
from robot_dyn.simulation.rollouts.run_file import write_rollouts
from robot_dyn.simulation.rollouts.table import columns, samples
from robot_dyn.simulation.run.outcome import Reason

_SHARED = ("joint_names", "t", "statistics", "sources", "metadata", "setup", "uncut", "comparison", "saved", "numbers")
_MOST_DRAWN = 2000  # largest number of runs for the quantiles in a notebook
_QUANTILES = {"least": 0.0, "median": 0.5, "largest": 1.0}


@final
class Rollouts(RolloutsData):
    """B runs with m samples each. Samples after the end of a run are nan; quantities not recorded are None.

    `runs[i]` is the `Trajectory` of one run and `runs[i:j]` a subset, numbered from 0; neither copies samples. All
    runs are sampled at the same times, so the state at an event that ends a run is not among the samples.

    Attributes:
        joint_names: Names of the n joints.
        t: Sample times, in [s], (m,).
        q, v: Positions and velocities, in [rad] and [rad/s], or [m] and [m/s], (B, m, n).
        u: Actuation within its bounds, (B, m, n), in [N m] or [N].
        kinetic, potential: Energies, (B, m), in [J].
        work: Work done up to each sample by the control and by each other effect, by name, (B, m), in [J].
        ends: Ends of the B runs, before their steps and loops are judged; see `outcomes`.
        steps: Number of steps of each run, (B,).
        evaluations: Evaluations of the equation of motion by the group of 64 runs that includes each run, (B,).
        statistics: Statistics of the longest run; the time is for all runs.
        sources: Names of the sources of work: the control and the effects without a potential.
        metadata: Texts common to all runs, as in `Trajectory`, without `varied`.
        varied: Values that differ from run to run, by name, (B, n).
        setup: Setup shared by all runs; None for runs read from a file.
        uncut: Names of the thresholds at which steps do not end, with `uncut=True`.
        comparison: Differences between some uncut runs and the same runs with steps that end at thresholds.
        q0, v0: Initial positions and velocities, (B, n).
        observed: Extremes, limits passed and chatter of each run, over all steps except for u of continuous control
            (see `remarks`).
        saved: Overview stored with runs read from a file; None otherwise.
        numbers: Number of each run, which determines its noise, (B,): the argument of `rollouts`, or for a slice the
            numbers in the original batch; None for a batch numbered from 0 on, and for runs read from a file.
    """

    def __iter__(self) -> Iterator[Trajectory]:
        return (self[run] for run in range(len(self)))

    @overload
    def __getitem__(self, run: int) -> Trajectory: ...
    @overload
    def __getitem__(self, run: slice) -> Rollouts: ...

    def __getitem__(self, run: int | slice) -> Trajectory | Rollouts:
        """Return the trajectory of a run, counted from the end if negative; or the runs in a slice.

        Positions and velocities are the recorded ones. Other quantities are recorded, or computed from them and the
        setup: the acceleration, the powers and energies, and the torque of a continuous controller without an
        integral. The rest is nan: work that was not recorded, the torque of other controllers and, for runs read from
        a file, all quantities that were not recorded. The trajectory has no error estimate, and only the remarks of
        `simulate` on limits, stops, chatter and the reference.

        Raises:
            QueryError: If q or v was not recorded, a slice is empty, or `run` is neither an integer nor a slice.
            IndexError: If no run has that number.
        """
        if isinstance(run, slice):
            chosen = range(len(self))[run]
            if not chosen:
                raise QueryError(f"there is no run in {run}: runs are numbered from 0 to {len(self) - 1}")
            some = self._some(run)
            return some if self.saved is None else replace(some, saved=of_some(some, chosen, self.saved))
        try:
            number = range(len(self))[index(None if isinstance(run, bool) else run)]  # type: ignore[arg-type]
        except TypeError:
            raise QueryError(f"runs are numbered: pass a whole number or a slice, got {run!r}") from None
        except IndexError:
            raise IndexError(f"there is no run {run}: runs are numbered from 0 to {len(self) - 1}") from None
        return trajectory(self, number)

    def _some(self, runs: slice) -> Rollouts:
        """Return the runs of a slice, without the `saved` overview of all runs."""
        by_run: dict[str, Any] = {
            x.name: taken(getattr(self, x.name), runs) for x in fields(self) if x.name not in _SHARED
        }
        numbers = np.arange(len(self)) if self.numbers is None else self.numbers
        statistics = replace(self.statistics, one_by_one=0, one_by_one_s=0.0)  # counted over the whole batch
        return replace(self, **by_run, statistics=statistics, numbers=numbers[runs], saved=None)

    @cached_property
    def overview(self) -> Overview:
        """The overview of all runs."""
        return self.saved or overview(self)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """The remarks of `simulate` on each run: limits, stops, chatter and the reference, by kind, joint and quantity.

        `Remark.runs` lists the affected runs: first the worst, whose values and text the remark contains, then the
        others in order. A sampled loop is linearised only for the run `worst`. Under continuous control in lock
        step, a violation of a limit of u between the instants counted by `Observed.instants` may be missed, and
        chatter is not detected.
        """
        return self.overview.remarks

    @property
    def rms_tracking_error(self) -> np.ndarray | None:
        """Tracking error of each run, as in `Trajectory`, (B,); None without a reference, or if q was not recorded."""
        return self.overview.rms_tracking_error

    @property
    def worst(self) -> int:
        """Number of the run to examine first.

        In order of priority: the first run to diverge; the run with the largest chatter; the run that exceeds a limit
        in the file by the largest fraction; the run with the largest tracking error; or 0.
        """
        return self.overview.worst

    def _columns(self) -> Iterator[Column]:
        return columns(self, self.overview)

    def _variables(self) -> Mapping[str, Variable]:
        return samples(self)

    def save(self, path: str | Path) -> Path:
        """Save the runs in the format of the suffix of `path`, completely or not at all; return the path.

            .npz      run file: all data except the `setup`, for `rd.read`; the default without a suffix
            .csv      `table`: a row for each run
            .parquet  the same columns, with quantity, joint and unit as metadata
            .nc       `to_xarray`, with all samples, as netCDF-3

        Formats other than .npz and .csv need `pip install 'robot-dyn[data]'`. For more, see `Trajectory.save`.

        Raises:
            RunFileError: If the suffix is unknown, or the file cannot be written.
            MissingExtraError: If the format needs a package that is not installed.
        """
        return save_data(self, path, lambda runs, file: write_rollouts(runs, file, runs.overview))

    def _repr_html_(self) -> str:
        joints = self.joint_names[:MAX_JOINTS]
        if self.q is None or not len(self):
            return page("Rollouts", text(self.summary))
        some = self.q[np.linspace(0, len(self) - 1, min(len(self), _MOST_DRAWN)).astype(int)]
        plots = []
        for i, (name, joint_type) in enumerate(zip(joints, joint_types(self), strict=False)):
            with np.errstate(all="ignore"):
                over_runs = np.nanquantile(some[:, :, i], list(_QUANTILES.values()), axis=0)
            plots.append(
                plot(f"{name} [{unit('q', joint_type)}]", self.t, dict(zip(_QUANTILES, over_runs, strict=True)))
            )
        return curves("Rollouts", self.summary, _QUANTILES, plots, len(self.joint_names) - len(joints))

    @property
    def summary(self) -> str:
        """Number of runs, how many ended early and why, remarks, tracking error, and the run to examine first."""
        count = "1 run" if len(self) == 1 else f"{len(self)} runs"
        lines = [f"{count} of {len(self.t)} samples to t = {self.t[-1]:g} s; {self._early()}"]
        lines += about_the_robot(self)
        if self.uncut:
            levels = ", ".join(self.uncut)
            lines.append(f"uncut: steps do not end at {levels}; {self.comparison or 'no run was compared'}")
        lines += self._one_by_one()
        if self.diverged.any():
            run = int(self.diverged.argmax())
            lines.append(f"run {run} diverged at t = {self.ended_s[run]:g} s; {self.outcome(run).text}")
        counted = len(self) > 1
        lines += lines_of(remark if counted else replace(remark, runs=()) for remark in self.remarks)
        errors = self.rms_tracking_error
        if errors is not None and np.isfinite(errors).any():
            most = int(np.nanargmax(errors))
            largest = f" in the median, {errors[most]:.3e} in run {most}" if counted else ""
            lines.append(f"{of_tracking(self, 'frame' in self.metadata)}: {np.nanmedian(errors):.3e} rms{largest}")
        again = "" if self.setup is None else f"; rd.simulate(runs.setup_of({self.worst})) repeats it alone"
        lines.append(f"worst run: {self.worst}{again}")
        return "\n".join(escaped(line) for line in lines)

    def _one_by_one(self) -> Iterator[str]:
        """Yield the number of runs that were simulated one by one, and their time."""
        ran = self.statistics
        if ran.one_by_one and len(self) > 1:
            remedy = ""
            if ran.one_by_one_s < ran.wall_s:  # the others were in lock step
                remedy = "; with uncut=True, runs that pass a threshold stay in lock step"
            count = "1 run was" if ran.one_by_one == 1 else f"{ran.one_by_one} runs were"
            yield f"{count} made one by one, in {ran.one_by_one_s:.2g} s of {ran.wall_s:.2g} s{remedy}"

    def _early(self) -> str:
        """Return the number of runs that ended early, and the reasons."""
        at = f" by an interrupt, the first at t = {self.ended_s[self.stopped].min():g} s" if self.stopped.any() else ""
        by_event = sum(outcome.reason is Reason.TERMINAL_EVENT for outcome in self.ends)
        early = f"{int(self.diverged.sum())} diverged, {int(self.stopped.sum())} stopped{at}"
        return early + (f", {by_event} ended by an event" if by_event else "")
