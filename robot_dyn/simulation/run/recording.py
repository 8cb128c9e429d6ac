"""The records of a time loop, and the recording of a run: samples, and the states that companion runs share.

`Records` and its functions are plain functions of arrays, for both loops; `Recording` is the result for Python.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.primitives import copy, evaluate
from robot_dyn.simulation.dynamics.event import Occurrence
from robot_dyn.simulation.dynamics.loop_state import Functions, Lanes, LoopConfig, Position, erase_ended
from robot_dyn.simulation.observation.observation import UNOBSERVED, Observation, observe
from robot_dyn.simulation.run.outcome import Outcome
from robot_dyn.simulation.setup.segment_table import SegmentTable

MOST_SHARED = 200_000  # states of a run that are compared with those of its companions


@final
@dataclass(frozen=True)
class Path:
    """States during a run, k of them.

    Attributes:
        key: Number of steps of the run before each state, (k,); equal keys match states of a run and its companions.
        t: Times, in [s], (k,).
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
        outcome: The end of the run.
        t: Times of the samples, (k,), in [s].
        y: States of the state equation, (k, m).
        sampled: y', u, K and V at the samples, (k, m + n + 2).
        shared: States at which runs of other steps are compared.
        step_log: States at the ends of all steps; the same as `shared` unless the method chooses its steps.
        steps: Number of steps.
        evaluations: Number of evaluations of the equation of motion.
        kinetic_peak: Largest kinetic energy at the energy checks, in [J].
        events: Events that occurred.
        ends: Ends of the steps, in [s], if the method chooses them; otherwise None.
    """

    outcome: Outcome
    t: np.ndarray
    y: np.ndarray
    sampled: np.ndarray
    shared: Path
    step_log: Path
    steps: int
    evaluations: int
    kinetic_peak: float
    events: tuple[Occurrence, ...] = ()
    ends: np.ndarray | None = None


class Records(NamedTuple):
    """The arrays in which a loop records.

    Attributes:
        rows: Entries of y that are stored in samples, (c,).
        t: Times of samples, (R,), in [s].
        y, sampled: Recorded entries of y, and the other numbers of a sample, (R, c, B) and (R, d, B).
        shared_t, shared: States that companion runs share, (S,) and (S, m).
        shared_place: Their segment and step, (S, 2).
        step_log_t, step_log: The ends of steps, (K,), and the states at the first of them, (k, m).
        columns: See `Observer.columns`; an array without columns stores nothing.
        observation: Extremes and levels of the runs; without rows, no step is observed.
    """

    rows: Array
    t: Array
    y: Array
    sampled: Array
    shared_t: Array
    shared: Array
    shared_place: Array
    step_log_t: Array
    step_log: Array
    columns: Array
    observation: Observation


class Loop(NamedTuple):
    """The data of a time loop, without the method and the events.

    Attributes:
        table: Segments of the run.
        lanes: States of the runs.
        records: Arrays in which the loop records.
        config: Settings.
        position: Position, which moves.
    """

    table: SegmentTable
    lanes: Lanes
    records: Records
    config: LoopConfig
    position: Position


def records_of(
    sizes: tuple[int, int],
    rows: Array,
    y: Array,
    sampled: Array,
    shared: int = 0,
    steps: int = 0,
    columns: Array | None = None,
    observation: Observation = UNOBSERVED,
) -> Records:
    """Return records in these arrays.

    Args:
        sizes: Entries of a state and number of joints, m and n.
        rows: See `Records`.
        y: See `Records`.
        sampled: See `Records`.
        shared: Number of states that companion runs share.
        steps: Number of ends of steps.
        columns: See `Records`; by default no column.
        observation: See `Records`; by default no step is observed.
    """
    m, n = sizes
    return Records(
        rows=rows,
        t=np.empty(len(y)),
        y=y,
        sampled=sampled,
        shared_t=np.empty(shared),
        shared=np.empty((shared, m)),
        shared_place=np.empty((shared, 2), np.int64),
        step_log_t=np.empty(steps),
        step_log=np.empty((steps, m)),
        columns=np.empty((1 + 3 * n, 0)) if columns is None else columns,
        observation=observation,
    )


def sample(functions: Functions, loop: Loop, t: float, y: Array, p: Array) -> None:
    """Store a sample of the states y."""
    lanes, records, row = loop.lanes, loop.records, loop.position.sample_row[0]
    first, end = loop.config.base, loop.config.base + y.shape[1]
    records.t[row] = t
    for j in range(len(records.rows)):
        copy(records.y[row, j, first:end], y[records.rows[j]])
    if len(lanes.sampled) > 0:
        evaluate(functions.sample, t, y, p, lanes.run_parameters, lanes.sampled)
        erase_ended(lanes.sampled, lanes)
        copy(records.sampled[row, :, first:end], lanes.sampled)
    loop.position.sample_row[0] += 1


def share(loop: Loop, t: float, y: Array) -> None:
    """Store a state for companion runs."""
    records, position = loop.records, loop.position
    row = position.shared_row[0]
    records.shared_t[row] = t
    records.shared_place[row, 0], records.shared_place[row, 1] = position.segment[0], position.step[0]
    copy(records.shared[row], y[:, 0])
    position.shared_row[0] += 1


def log_step(loop: Loop, t: float, y: Array) -> None:
    """Store the end of a step, until the log is full."""
    records, row = loop.records, loop.position.step_row[0]
    if row < len(records.step_log_t):
        records.step_log_t[row] = t
        if row < len(records.step_log):
            copy(records.step_log[row], y[:, 0])
        loop.position.step_row[0] += 1


def observe_step(loop: Loop, latest: Array, start: float, t: float, acted: bool) -> None:
    """Observe a step of a single run: y at its end, and u of its latest evaluation.

    Args:
        loop: The loop; an observer takes a column of its records, if there are any.
        latest: The latest rate with u, (m + n, 1); its v counts if y has momenta.
        start: Time at the start of the step, in [s].
        t: Time at its end, in [s].
        acted: True if the controller acted at the start.
    """
    records, config, y = loop.records, loop.config, loop.lanes.y
    if records.observation.low.shape[1] == 0:
        return
    n, m = config.n, len(y)
    q, v, u = y[:n], y[n : 2 * n], latest[m : m + n]
    if config.canonical:
        v = latest[:n]
    observe(records.observation, start, t, q, v, u, acted or config.held == 0)
    if records.columns.shape[1] == 0:
        return
    column = loop.position.column[0]
    records.columns[0, column] = t
    copy(records.columns[1 : 1 + n, column], q[:, 0])
    copy(records.columns[1 + n : 1 + 2 * n, column], v[:, 0])
    copy(records.columns[1 + 2 * n :, column], u[:, 0])
    loop.position.column[0] += 1
