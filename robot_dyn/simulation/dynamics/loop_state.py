"""Data of a time loop: functions of the state equation, arrays of runs, rules, and the reasons for its return."""

from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.values import aligned
from robot_dyn.integrate.primitives import below
from robot_dyn.simulation.dynamics.state_equation import StateEquation

_FIRST = np.zeros(1, np.int64)


class Ended(IntEnum):
    """Why the loop returned."""

    DONE = 0
    PAUSED = 1  # its budget of steps is spent
    NEEDS_REVIEW = 2  # the next step needs a check; y is the state before it
    TICK = 3  # the torque of the controller is not finite
    GAINS = 4  # energy may grow without a source; y is the state after the step
    TOO_SMALL = 5  # no step large enough to change t in floating point meets the tolerance
    NOT_FINITE = 6  # the rate at y is not finite
    FAST = 7  # a joint moves without bound; y is the state after the step
    EVENT = 8  # an event; y is the state at the event
    PAYLOAD = 9  # a payload is picked up or dropped; y is the state before it
    CHANGED = 10  # the mode, and with it the side of a threshold, has changed; y is the state after it
    ACCUMULATED = 11  # mode changes accumulate in a very short time
    UNSETTLED = 12  # the state and the mode after an event were not found


class Why(IntEnum):
    """Why a run in lock step ended."""

    GOES_ON = 0
    OVERFLOWED = 1
    GAINED = 2
    NOT_FOUND = 3  # the stages of a step were not found


class _Entries(NamedTuple):
    """Entries of `now`, the position of the loop."""

    SEGMENT: int = 0
    STEP: int = 1  # within the segment
    ROW: int = 2  # next row of the samples
    STEPS: int = 3  # steps done in total
    SEEN: int = 4  # states shared with companions in total
    SHARED: int = 5  # next row of the shared states
    BUDGET: int = 6  # steps to do before the loop returns
    EVALUATIONS: int = 7  # evaluations of the rate in total
    COLUMN: int = 8  # next column of the observer's data
    DUE: int = 9  # period of the next sample, where steps do not end at samples
    MET: int = 10  # the same for the next shared state
    WALKED: int = 11  # next row of the ends of steps
    EVENT: int = 12  # the switching function that has changed sign


Now = _Entries()


class Functions(NamedTuple):
    """Functions of the state equation, from `evaluate`, called by steps and the time loop.

    Attributes:
        rate: y'; for a single run also u.
        tick: Run parameters after a tick.
        energy: K and V.
        sample: Contents of a sample.
        jacobian: See `RightSide`.
        events: Values of the events.
        step, behind: See `RightSide`.
        actuation: u, for runs in lock step where u changes between ticks.
        bodies: Mass matrix and loads, if joints may be held; see `bodies`.
    """

    rate: Any
    tick: Any
    energy: Any
    sample: Any
    jacobian: Any = 0
    events: Any = 0
    step: Any = 0
    behind: Any = 0
    actuation: Any = 0
    bodies: Any = 0


class Runs(NamedTuple):
    """W runs: states (m, W), run parameters (O, W) and the status of each run (W,); the rest is workspace.

    Attributes:
        y, run_parameters: State and parameters of each run; the values that a sampled controller holds come first.
        after, made, command, u, energies, size, lost: y⁺, a sample, a tick, the actuation, K and V, Σ |y⁺|, and
            whether stages were not found.
        alive, why, ended: 1 while the run continues; the reason and the time of its end.
        last: State at the end of each run, (m, W).
        energy, scale: E(0), and 1 + |K(0)| + |V(0)|.
        peak: Largest K at the energy checks.
        keys: Seed and number of each run, which determine its noise, (2, W), as uint64.
    """

    y: Array
    run_parameters: Array
    after: Array
    made: Array
    command: Array
    u: Array
    energies: Array
    size: Array
    lost: Array
    alive: Array
    why: Array
    ended: Array
    last: Array
    energy: Array
    scale: Array
    peak: Array
    keys: Array


class Rules(NamedTuple):
    """Settings of the time loop.

    Attributes:
        n, works: Number of joints, and number of works at the end of y.
        states: Number of controller states, which follow q and v.
        held: Number of torques in the zero-order hold of a sampled controller; 0 otherwise.
        instants, acting: Ticks per controller period, and the index of the one at which the torque changes.
        deviates: Number of trailing controller states that are redrawn before each tick.
        canonical: Whether y has momenta in place of velocities.
        alone: Whether the driver, not the loop, checks what may end a run.
        largest: Σ |y| beyond which a step is doubtful, or a run in lock step ends.
        every, thin: Steps between shared states, 0 for none; and number of shared states per state kept.
        base: Column of the first run in the records.
        apart: Steps between observations of u in lock step; 0 if u is held between ticks.
    """

    n: int
    works: int
    states: int
    held: int
    instants: int
    acting: int
    deviates: int
    canonical: bool
    alone: bool
    largest: float
    every: int
    thin: int
    base: int
    apart: int


def rules_of(
    equation: StateEquation, alone: bool, largest: float, every: int = 0, thin: int = 1, base: int = 0, apart: int = 0
) -> Rules:
    """The rules of a loop over a state equation."""
    n, controller = equation.plant.dynamics.n, equation.controller
    ticks = (1, 0, 0)
    if controller is not None:
        ticks = len(controller.instants), controller.acting_instant, controller.deviates
    return Rules(
        n, len(equation.sources), equation.state_size, n if equation.sampled else 0, *ticks,
        equation.canonical, alone, largest, every, thin, base, apart,
    )  # fmt: skip


def runs_of(
    equation: StateEquation, y: np.ndarray, run_parameters: np.ndarray, made: int, numbers: np.ndarray = _FIRST
) -> Runs:
    """Runs with states y (m, W), run parameters (O, W), and `numbers` (W,), their positions in a batch."""
    m, W = y.shape
    held, states = equation.plant.dynamics.n if equation.sampled else 0, equation.state_size
    seed, run = (0, 0) if equation.controller is None else equation.controller.noise_key
    keys = np.array([np.full(W, seed, np.uint64), np.uint64(run) + numbers.astype(np.uint64)])
    start, after = aligned((2, m, W))
    start[...] = y
    return Runs(
        start, np.array(run_parameters, order="C"), after, np.empty((made, W)),
        np.empty((held + states, W)), np.empty((equation.plant.dynamics.n, W)), np.empty((2, W)), np.empty(W),
        np.zeros(W, np.int64), np.ones(W, np.int64), np.zeros(W, np.int64), np.zeros(W), np.zeros((m, W)),
        np.zeros(W), np.ones(W), np.zeros(W), keys,
    )  # fmt: skip


def erase_ended(x: Array, runs: Runs) -> None:
    """Write nan into x (r, W) for the runs that have ended."""
    if below(runs.why, 1):
        return
    for b in range(len(runs.alive)):
        if runs.alive[b] == 0:
            erase(x, b)


def erase(x: Array, b: int) -> None:
    """Write nan over the numbers of a run."""
    for e in range(len(x)):
        x[e, b] = np.nan
