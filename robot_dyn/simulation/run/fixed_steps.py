"""Steps of fixed length without events: calls of `time_loop`, and the checks in Python between them.

The loop returns at a doubtful step: a number overflows, stages do not converge, or energy grows. The interpreted state
equation then repeats the step, and only it ends a run, with the reason.
"""

from __future__ import annotations

from fractions import Fraction
from math import ceil, inf
from typing import ClassVar, cast, final

import numpy as np

from robot_dyn.foundations.arithmetic import FLOAT64
from robot_dyn.foundations.errors import RobotDynError, is_mistake
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.simulation.dynamics.loop_state import Ended, Functions
from robot_dyn.simulation.engine.interpreted import interpreted, system
from robot_dyn.simulation.run.outcome import Reason
from robot_dyn.simulation.run.recording import MOST_SHARED, Path, observe_step
from robot_dyn.simulation.run.state import RunState
from robot_dyn.simulation.run.time_loop import WATCHED, changes_torque, time_loop
from robot_dyn.simulation.run.watch import LARGEST, one_step, overflowed
from robot_dyn.simulation.setup.schedule import ON_STEP, paced
from robot_dyn.simulation.setup.setup import Setup

_DOUBTFUL = 1e6  # Σ |y| from which machine code, which does not detect a singular M, leaves a step to Python


@final
class FixedSteps:
    """Steps of fixed length of a run.

    Args:
        state: The state of the run.
        pace: Length of a step, in steps of the setup; 1 records samples.

    Attributes:
        first_budget: Steps of machine code before its speed is measured.
    """

    first_budget: ClassVar[int] = 1000

    def __init__(self, state: RunState, pace: Fraction) -> None:
        setup, counts, m, n = state.setup, state.table.counts, state.equation.size, state.config.n
        self.state, self.segments = state, paced(setup.segments, pace)
        self.method = cast(Integrator, setup.method)
        self.stepper = self.method.stepper(FLOAT64, m, n, m + n, 1, state.equation.widths)
        self.loop = state.engine.loop() or time_loop(self.stepper.step)
        every, thin = _shared(setup, pace, len(counts))
        config = state.config._replace(
            largest=_DOUBTFUL if state.engine.is_compiled else LARGEST,
            every=every,
            thin=thin,
            sample_period=float(setup.record_every_s or 0.0),
            sample_slack=ON_STEP * setup.nominal_step_s,
        )
        state.position.sample_time[0] = 0.0 if pace == 1 else inf
        rows = samples_at_most(setup, counts) if pace == 1 else 1
        state.allocate(config, rows, int((-(-counts // every)).sum()) // thin + 2, 0)

    @property
    def time(self) -> float:
        """The time reached, in [s]."""
        table, last = self.state.table, len(self.state.table.starts) - 1
        s, k = min(self.state.segment, last), int(self.state.position.step[0])
        if k == table.counts[s]:
            return float(table.starts[min(s + 1, last)])
        return float(table.starts[s] + k * table.lengths[s])

    def room(self, budget: int) -> int:
        """Return the number of steps before the loop must return: `budget`, because the records have enough rows."""
        return budget

    def detect_stiffness(self) -> None:
        """Return None: a run of fixed steps is not replaced by one of another method."""

    def advance(self) -> Ended:
        """Call the loop until it returns."""
        state, (_, coefficients, work) = self.state, self.stepper
        try:
            return Ended(self.loop(state.functions, coefficients, work, state.loop, state.stop))
        except RobotDynError as error:  # in a step; y is the state before it
            if is_mistake(error):
                raise
            return Ended.NEEDS_REVIEW

    def judge(self, ended: Ended) -> None:
        """Handle what the loop returned for: change payloads, or repeat a doubtful step, tick or energy check.

        The interpreted equation repeats them, and DivergedError ends the run.
        """
        state = self.state
        if ended is Ended.TICK:
            state.tick()
        elif ended is Ended.PAYLOAD:
            state.events += state.change_payload()
        elif ended is Ended.NEEDS_REVIEW:
            self._step()
        elif ended is not Ended.PAUSED:
            state.watch.check_energy(self.time, state.y)

    def _step(self) -> None:
        """Take one step by the interpreted equation."""
        state, s, t, y = self.state, self.state.segment, self.time, self.state.y
        h, position = float(state.table.lengths[s]), state.position
        functions, p = interpreted(state.equation, state.watch), state.table.parameters[s]
        if self.method.nonsmooth:
            y, latest = self._jump(functions, t, h, p), self.stepper.work.K[-1]
        else:
            latest = np.empty((len(y) + state.config.n, 1))
            right_side = system(functions, state.equation, p, state.lanes.run_parameters, latest)
            y = one_step(self.method, right_side, t, y, h, state.watch)
        state.lanes.y[:, 0] = y
        acted = position.step[0] == 0 and changes_torque(state.config, int(state.table.ticks[s]))
        state.observed(lambda: observe_step(state.loop, latest, t, t + h, acted))
        position.step[0] += 1
        position.steps[0] += 1
        if position.steps[0] % WATCHED == 0:
            state.watch.check_energy(t + h, y)

    def _jump(self, functions: Functions, t: float, h: float, p: np.ndarray) -> np.ndarray:
        """Return the state after a step in which velocities may jump."""
        (step, coefficients, work), lanes, watch = self.stepper, self.state.lanes, self.state.watch
        lanes.p[:] = p
        watch.attempt(t, self.state.y, lambda: step(functions, coefficients, work, t, h, lanes))
        if lanes.failed[0] or overflowed(lanes.after):
            raise watch.diverged(Reason.STATE_OVERFLOWS, t, self.state.y)
        return lanes.after[:, 0].copy()

    def paths(self) -> tuple[Path, Path, None]:
        """Return the states shared with companions twice, because they are also the log of steps, and None."""
        records, rows = self.state.records, int(self.state.position.shared_row[0])
        path = Path(self._keys(records.shared_place[:rows]), records.shared_t[:rows], records.shared[:rows])
        return path, path, None

    def _keys(self, places: np.ndarray) -> np.ndarray:
        """Return the number of steps of the setup before each place (segment, step), (k,)."""
        first = np.array([*(segment.first for segment in self.segments), self.state.setup.steps])[places[:, 0]]
        pace = np.array([*(float(segment.pace) for segment in self.segments), 1.0])[places[:, 0]]
        return first + np.rint(places[:, 1] * pace).astype(np.int64)


def _shared(setup: Setup, pace: Fraction, segments: int) -> tuple[int, int]:
    """Return the number of steps between states that companions share, and the number of these per stored state."""
    few = setup.steps <= MOST_SHARED
    apart = 1 if few else 30 * ceil(setup.steps / MOST_SHARED)  # steps of 2, 3 and 5 meet at every 30th
    thin = 2 * ceil(segments / MOST_SHARED) if segments > MOST_SHARED else 1
    return max(1, int(apart / pace)), thin


def samples_at_most(setup: Setup, counts: np.ndarray) -> int:
    """Return the largest possible number of samples, for the numbers of steps in the segments."""
    steps = int(counts.sum())
    return min(steps, int(setup.duration_s / setup.record_every_s) + 2) if setup.record_every_s else steps
