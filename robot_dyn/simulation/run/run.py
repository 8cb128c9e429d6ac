"""A run: a setup and an engine → a recording. It calls a time loop until the run ends.

    run = Run(setup, choose(setup));   recording = run.record()

One of two loops takes the steps: `EventSteps` if the method chooses its steps or steps end at events, otherwise
`FixedSteps`. The loop returns for progress, for Ctrl-C, for the observer, and for anything that only the interpreted
equation can do.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from fractions import Fraction
from math import inf
from time import perf_counter
from typing import cast, final

import numpy as np

from robot_dyn.foundations import waiting
from robot_dyn.simulation.dynamics.loop_state import Ended
from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.engine.interpreted import sample
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.run.event_steps import EventSteps
from robot_dyn.simulation.run.fixed_steps import FixedSteps
from robot_dyn.simulation.run.outcome import GivesUp, Outcome, Reason, Stiff
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.run.state import RunState
from robot_dyn.simulation.run.watch import DivergedError
from robot_dyn.simulation.setup.schedule import mesh
from robot_dyn.simulation.setup.segment_table import segment_table
from robot_dyn.simulation.setup.setup import Setup

_PAUSE_S = 0.1  # between checks for Ctrl-C


@final
class Run:
    """A run of a setup, in progress.

    Args:
        setup: The setup.
        engine: The engine of its state equation.
        pace: Length of steps, as a multiple of the step of the setup; or the times at which steps end, in [s].
        on_progress: Called with the time reached, in [s], at each step or about ten times a second.
        observer: Observer of each step, or None.
        samples: True to record samples; False for a companion run.
        max_evaluations: Number of evaluations of the equation of motion after which the run stops with `TooLong`.
        thresholds: True to end steps at the thresholds of effects; otherwise the effects switch within steps.
        may_replace: True to stop with `Stiff` or `Accumulation` if another method is better suited.

    Attributes:
        state: The data that the steps change.
        steps: The steps of one of the loops.
        seconds: Time that the run took, from its construction to its end, without compiling, in [s].
    """

    def __init__(
        self,
        setup: Setup,
        engine: Engine,
        pace: Fraction | np.ndarray = Fraction(1),
        *,
        on_progress: Callable[[float], object] | None = None,
        observer: Observer | None = None,
        samples: bool = True,
        max_evaluations: float = inf,
        thresholds: bool = True,
        may_replace: bool = False,
    ) -> None:
        self._on_progress, self._activity = on_progress, "simulating" if samples else "estimating the error of"
        self.seconds, self._began, self._compiling_s = 0.0, perf_counter(), engine.compiling_s()
        if not setup.finds_events:
            table = segment_table(setup, cast(Fraction, pace))
            self.state = RunState(setup, engine, table, observer)
            self.steps: FixedSteps | EventSteps = FixedSteps(self.state, cast(Fraction, pace))
            return
        if setup.method.controls_error:
            ends = pace if isinstance(pace, np.ndarray) else None
        else:
            ends = mesh(setup.segments, cast(Fraction, pace))
        self.state = RunState(setup, engine, segment_table(setup), observer)
        self.steps = EventSteps(
            self.state,
            ends,
            samples=samples,
            max_evaluations=max_evaluations,
            thresholds=thresholds,
            may_replace=may_replace,
        )

    def run(self) -> Recording | GivesUp:
        """Run to the end, or until the run gives up so that another one can replace it."""
        try:
            with np.errstate(all="ignore"):  # an overflow ends the run
                ended = self._to_the_end()
        except DivergedError as end:
            ended = end.outcome
        except KeyboardInterrupt:
            ended = Outcome(Reason.INTERRUPTED, self.steps.time)
        recording = self._recording(ended) if isinstance(ended, Outcome) else ended
        compiling = self.state.engine.compiling_s() - self._compiling_s
        self.seconds = perf_counter() - self._began - compiling
        return recording

    def record(self) -> Recording:
        """Run to the end. The run must not give up: no other may replace it, and its evaluations are not limited."""
        recording = self.run()
        assert isinstance(recording, Recording)
        return recording

    def _to_the_end(self) -> Outcome | GivesUp:
        """Call the loop until the run ends or gives up."""
        steps, most, first = self.steps, self.state.engine.most_steps, self.steps.first_budget
        budget, reported, began = int(min(first, most)), -1.0, perf_counter()
        reports_wait = waiting.LOG.isEnabledFor(logging.INFO)
        while True:
            if self._on_progress is not None and steps.time > reported:
                reported = steps.time
                self._on_progress(reported)
            called = perf_counter()
            ended = self._advance(budget)
            if ended is Ended.DONE:
                break
            if not isinstance(ended, Ended):
                return ended
            if self.state.stop[0]:
                raise KeyboardInterrupt
            if (outcome := steps.judge(ended)) is not None:
                return outcome
            now = perf_counter()
            if ended is Ended.PAUSED and budget < most:
                budget = int(np.clip(budget * _PAUSE_S / max(now - called, 1e-9), first // 10, 100 * budget))
            if reports_wait and now - began > waiting.PATIENCE_S:
                reports_wait = False
                waiting.LOG.info(
                    "%s a run: t = %.3g of %.3g s", self._activity, steps.time, self.state.setup.duration_s
                )
        if self._on_progress is not None and steps.time > reported:
            self._on_progress(steps.time)
        return Outcome(Reason.END, self.state.setup.duration_s)

    def _advance(self, budget: int) -> Ended | Stiff:
        """Take `budget` steps, and empty the observer or enlarge the records when they are full.

        Return why the last call of the loop ended; or `Stiff` if a stiff method should replace the run.
        """
        observer = self.state.observer
        while True:
            if (stiff := self.steps.detect_stiffness()) is not None:
                return stiff
            steps = min(budget, self.steps.room(budget))
            if observer is not None:
                steps = min(steps, observer.room)
            self.state.position.budget[0] = steps
            ended = self.state.observed(self.steps.advance)
            budget -= steps
            if ended is not Ended.PAUSED or budget <= 0:
                return ended

    def _recording(self, outcome: Outcome) -> Recording:
        state, records, rows = self.state, self.state.records, int(self.state.position.sample_row[0])
        if not rows and len(records.t):  # interrupted, or without a tick, before the first sample
            records.t[0], records.y[0, :, 0], records.sampled[0], rows = 0.0, state.start, np.nan, 1
        shared, step_log, ends = self.steps.paths()
        recording = Recording(
            outcome=outcome,
            t=records.t[:rows],
            y=records.y[:rows, :, 0],
            sampled=records.sampled[:rows, :, 0],
            shared=shared,
            step_log=step_log,
            steps=int(state.position.steps[0]),
            evaluations=int(state.position.evaluations[0]),
            kinetic_peak=float(state.lanes.peak[0]),
            events=tuple(event for event in state.events if event.t <= outcome.t),  # not those of states that overflow
            ends=ends,
        )
        if state.setup.method.nonsmooth:
            _complete_samples(state, recording)
        return recording


def _complete_samples(state: RunState, recording: Recording) -> None:
    """Write the rates at samples by the interpreted equation where machine code leaves them nan (nonsmooth methods)."""
    m, n = state.equation.size, state.config.n
    for t, y, sampled in zip(recording.t, recording.y, recording.sampled, strict=True):
        if np.isnan(sampled[:m]).all():
            sample(state.equation, float(t), y, sampled[m : m + n].copy() if state.config.held else None, sampled)
