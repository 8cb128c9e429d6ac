"""Values derived from the record of a run on first access: samples, energy ledger, tracking error, loads, remarks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter
from typing import final

import numpy as np

from robot_dyn.effects.plant import Plant
from robot_dyn.simulation.diagnostics.damped_task import damped
from robot_dyn.simulation.diagnostics.imbalance import cause
from robot_dyn.simulation.diagnostics.runaway import runaway, step_too_long
from robot_dyn.simulation.diagnostics.step_remarks import remarks
from robot_dyn.simulation.diagnostics.stiff_motion import limited_by_stability
from robot_dyn.simulation.diagnostics.unstable_loop import explained, unstable
from robot_dyn.simulation.observation.observation import Observed
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.observation.remarks import Remark
from robot_dyn.simulation.results.acting import acting, at_stop, wrenches
from robot_dyn.simulation.results.causes import broken_away, effect_torques, plant_of
from robot_dyn.simulation.results.error_estimate import ErrorEstimate
from robot_dyn.simulation.results.ledger import Ledger, leak
from robot_dyn.simulation.results.provenance import origin, settings_text
from robot_dyn.simulation.results.samples import Columns, Tracking, columns, ledger, tracking_of
from robot_dyn.simulation.run.outcome import Ending, Outcome
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.setup.setup import Setup


@final
@dataclass(frozen=True, eq=False)
class Results:
    """The attributes of a `Trajectory` that are computed from the record and the setup of a run.

    Attributes:
        setup: The setup, with the method of the run.
        record: Recording of the run.
        observer: Observer of the run, at its end.
        error: Estimated error, or None.
        texts: Copy of the texts of the setup.
        compiled: True if machine code ran.
        before: Remarks on earlier runs that this run replaced.
    """

    setup: Setup
    record: Recording
    observer: Observer
    error: ErrorEstimate | None
    texts: dict[str, str]
    compiled: bool
    before: tuple[Remark, ...]
    q = property(attrgetter("_columns.q"))
    v = property(attrgetter("_columns.v"))
    u = property(attrgetter("_columns.u"))
    desired = property(attrgetter("_tracking.desired"))
    desired_velocity = property(attrgetter("_tracking.desired_velocity"))
    tracking_error = property(attrgetter("_tracking.tracking_error"))

    @cached_property
    def _columns(self) -> Columns:
        return columns(self.setup.equation, self.record.t, self.record.y, self.record.sampled)

    @cached_property
    def a(self) -> np.ndarray:
        """Accelerations at the samples, (m, n)."""
        if not self.setup.equation.impulses or not self._asks_plant:
            return self._columns.a
        return broken_away(self._plant, self.record.t, self._columns, self.effect_states)

    @property
    def _asks_plant(self) -> bool:
        """True if effects may be called again: undeclared parts only with an error estimate and no interrupt."""
        again = self.setup.estimate_error and self.record.outcome.ending is not Ending.STOPPED
        return again or not self.setup.undeclared

    @cached_property
    def _plant(self) -> Plant:
        return plant_of(self.setup.plant, self.compiled)

    @property
    def power(self) -> dict[str, np.ndarray]:
        """Power of each source, (m,), by name."""
        return dict(zip(self.setup.equation.sources, self._columns.power.T, strict=True))

    @cached_property
    def ledger(self) -> Ledger:
        """Energy and work, and why the ledger does not close, unless undeclared parts must not be called."""
        energy = ledger(self.setup.equation, self.record)
        explains = self.setup.estimate_error or not self.setup.undeclared  # the search calls them 4000 times
        if explains and self.record.outcome.ending is not Ending.STOPPED and leak(energy, self.error, self.q):
            return replace(energy, cause=cause(self.setup, self.record))
        return energy

    @cached_property
    def _tracking(self) -> Tracking:
        return tracking_of(self.setup, self.record.t, self.q)

    @property
    def outcome(self) -> Outcome:
        """Reason and time of the end. A divergence is attributed to the step or the loop where these explain it."""
        outcome = self.record.outcome
        return explained(outcome, self.setup, self._of_control) if outcome.ending is Ending.DIVERGED else outcome

    @property
    def metadata(self) -> dict[str, str]:
        """Texts: settings, origin, and the texts of the setup."""
        return settings_text(self.setup) | origin(self.setup, self.compiled) | self.texts

    @property
    def wrenches(self) -> dict[str, np.ndarray]:
        """External wrench by link."""
        return wrenches(self.setup.plant, self.record.t, self.q)

    @property
    def at_stop(self) -> np.ndarray | None:
        """True where a joint is at or beyond a stop, (m, n); None without stops."""
        return at_stop(self.setup.plant, self.q)

    @cached_property
    def _observed(self) -> Observed:
        return self.observer.close()

    @property
    def extremes(self) -> np.ndarray:
        """The least and the largest of q, v and u over all steps, (3, 2, n)."""
        return self._observed.extremes[0]

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Remarks on observations, replaced runs, steps and control."""
        observed, samples = self._observed, np.hstack([self.q, self.v, self.u])
        return (
            *remarks(self.setup, self.observer, observed, self.record.t, samples, self.power), *self.before,
            *limited_by_stability(self.setup, self.record), *self._of_control,
        )  # fmt: skip

    @cached_property
    def _of_control(self) -> tuple[Remark, ...]:
        """Remarks on the step and on the controller. An interrupted controller is not called again."""
        if self.record.outcome.ending is Ending.STOPPED:
            return ()
        runs_away = self.record.outcome.ending is Ending.DIVERGED or bool(runaway(self.setup, self.observer.fastest))
        doubtful = runs_away or (self.error is not None and self.error.ends_early)
        step = step_too_long(self.setup, self.record.outcome.t) if doubtful else ()
        loop = unstable(self.setup, self.record.t, self.record.y, runs_away, end=self.record.outcome.t)
        return (*step, *loop, *damped(self.setup, self.record))

    @property
    def acting(self) -> tuple[str, ...]:
        """Names of edits, effects and control."""
        return acting(self.setup)

    @property
    def controller_states(self) -> np.ndarray | None:
        """States of the controller at the samples."""
        return self.setup.equation.controller_states(self.record.y)

    @property
    def effect_states(self) -> dict[str, np.ndarray]:
        """States of each effect at the samples, by name."""
        return self.setup.equation.effect_states(self.record.y)

    @property
    def effect_torques(self) -> dict[str, np.ndarray] | None:
        """Torque of each effect on the joints at the samples; None if effects must not be called again."""
        if not self._asks_plant:
            return None
        return effect_torques(self._plant, self.record.t, self._columns._replace(a=self.a), self.effect_states)
