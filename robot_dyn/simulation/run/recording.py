"""What a time loop records, and the recording of a run: samples, and the states that companion runs share.

`Records` and its functions are plain functions of arrays, for both loops; `Recording` is the result for Python.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.primitives import copy, evaluate
from robot_dyn.simulation.dynamics.event import Occurrence
from robot_dyn.simulation.dynamics.loop_state import Functions, Now, Rules, Runs, erase_ended
from robot_dyn.simulation.observation.observation import Observation, observe
from robot_dyn.simulation.run.outcome import Outcome

MOST_SHARED = 200_000  # states of a run that are compared with those of its companions


@final
@dataclass(frozen=True)
class Path:
    """States on the way, k of them.

    Attributes:
        key: Steps of the run before each, (k,), by which the states of a run and of its companions are matched.
        t: In [s], (k,).
        y: States of the state equation, (k, m).
    """

    key: np.ndarray
    t: np.ndarray
    y: np.ndarray


@final
@dataclass(frozen=True, eq=False)
class Recording:
    """The states of a run.

    Attributes:
        outcome: How it ended.
        t: Of the samples, (k,), in [s].
        y: States of the state equation, (k, m).
        made: What follows from them: y', u, K and V, (k, m + n + 2).
        shared: States at which runs of other steps are compared.
        step_log: States at the ends of all steps; the same, unless the method chooses its steps.
        steps: Number of steps.
        evaluations: Of the equation of motion.
        kinetic_peak: Largest kinetic energy that is known, beside that of the samples, in [J].
        events: That occurred.
        ends: Of the steps, in [s], where the method chooses them; None for any other.
    """

    outcome: Outcome
    t: np.ndarray
    y: np.ndarray
    made: np.ndarray
    shared: Path
    step_log: Path
    steps: int
    evaluations: int
    kinetic_peak: float
    events: tuple[Occurrence, ...] = ()
    ends: np.ndarray | None = None


class Records(NamedTuple):
    """The arrays that a loop records in.

    Attributes:
        rows: Entries of y that samples hold, (c,).
        t: Times of samples, (R,), in [s].
        y, made: Those entries, and what else a sample holds, (R, c, B) and (R, d, B).
        shared_t, shared: States that companion runs share, (S,) and (S, m).
        shared_place: The segment and the step at which they are, (S, 2).
        step_log_t, step_log: The ends of steps, (K,), and the states at the first of them, (k, m).
        columns: As of `Observer.columns`; without any, none is written.
        observation: What was observed of the runs; without any, no step is shown.
    """

    rows: Array
    t: Array
    y: Array
    made: Array
    shared_t: Array
    shared: Array
    shared_place: Array
    step_log_t: Array
    step_log: Array
    columns: Array
    observation: Observation


def records_of(
    rows: Array, y: Array, made: Array, shared: Array, step_log: Array, columns: Array, observation: Observation
) -> Records:
    """Records in these arrays, with room for as many times."""
    times = (np.empty(len(x)) for x in (y, shared, step_log))
    t, shared_t, step_log_t = times
    place = np.empty((len(shared), 2), np.int64)
    return Records(rows, t, y, made, shared_t, shared, place, step_log_t, step_log, columns, observation)


def sample(
    functions: Functions, runs: Runs, records: Records, base: int, now: Array, t: float, y: Array, p: Array
) -> None:
    """Store a sample of the states y; `base` is the first of the runs in the records."""
    row, W = now[Now.ROW], y.shape[1]
    records.t[row] = t
    for j in range(len(records.rows)):
        copy(records.y[row, j, base : base + W], y[records.rows[j]])
    if len(runs.made) > 0:
        evaluate(functions.sample, t, y, p, runs.run_parameters, runs.made)
        erase_ended(runs.made, runs)
        copy(records.made[row, :, base : base + W], runs.made)
    now[Now.ROW] += 1


def share(records: Records, now: Array, t: float, y: Array) -> None:
    """Store a state for companion runs."""
    row = now[Now.SHARED]
    records.shared_t[row] = t
    records.shared_place[row, 0], records.shared_place[row, 1] = now[Now.SEGMENT], now[Now.STEP]
    copy(records.shared[row], y[:, 0])
    now[Now.SHARED] += 1


def log_step(records: Records, now: Array, t: float, y: Array) -> None:
    """Store the end of a step, while there is room."""
    row = now[Now.WALKED]
    if row < len(records.step_log_t):
        records.step_log_t[row] = t
        if row < len(records.step_log):
            copy(records.step_log[row], y[:, 0])
        now[Now.WALKED] += 1


def show(
    runs: Runs, records: Records, rules: Rules, latest: Array, now: Array, began: float, t: float, acted: bool
) -> None:
    """Observe a step of a single run: y at its end, and u, or v and u, of its latest evaluation.

    For an observer it is written into a column, too, for which its driver leaves room.
    """
    if records.observation.low.shape[1] == 0:
        return
    n, m = rules.n, len(runs.y)
    q, v, u = runs.y[:n], runs.y[n : 2 * n], latest[m : m + n]
    if rules.canonical:
        v = latest[:n]
    observe(records.observation, began, t, q, v, u, acted or rules.held == 0)
    if records.columns.shape[1] == 0:
        return
    c = now[Now.COLUMN]
    records.columns[0, c] = t
    copy(records.columns[1 : 1 + n, c], q[:, 0])
    copy(records.columns[1 + n : 1 + 2 * n, c], v[:, 0])
    copy(records.columns[1 + 2 * n :, c], u[:, 0])
    now[Now.COLUMN] += 1
