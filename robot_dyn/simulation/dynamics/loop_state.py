"""What a time loop works on: functions of the state equation, arrays of runs, rules, and why it returned."""

from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.integrate.primitives import below
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.values import aligned

_FIRST = np.zeros(1, np.int64)


class Ended(IntEnum):
    """Why the loop returned."""

    DONE = 0
    PAUSED = 1  # its budget of steps is spent
    NEEDS_REVIEW = 2  # the next step is to be looked at; y is the state before it
    TICK = 3  # the controller asks for no finite torque
    GAINS = 4  # energy may grow without a source; y is the state after the step
    TOO_SMALL = 5  # no step large enough to change t in floating point meets the tolerance
    NOT_FINITE = 6  # the rate at y
    FAST = 7  # a joint moves without bound; y is the state after the step
    EVENT = 8  # y is the state at it
    PAYLOAD = 9  # a payload is picked up or dropped; y is the state before it
    CHANGED = 10  # the mode, and with it the side of a threshold; y is the state behind it
    ACCUMULATED = 11  # mode changes accumulate in a very short time
    UNSETTLED = 12  # the state and the mode behind an event were not found


class Why(IntEnum):
    """Why a run in lock step ended."""

    GOES_ON = 0
    OVERFLOWED = 1
    GAINED = 2
    NOT_FOUND = 3  # the stages of a step


class _Entries(NamedTuple):
    """Entries of `now`, where the loop is."""

    SEGMENT: int = 0
    STEP: int = 1  # of the segment
    ROW: int = 2  # of the samples, next
    STEPS: int = 3  # done in all
    SEEN: int = 4  # states shared with companions, in all
    SHARED: int = 5  # row of these, next
    BUDGET: int = 6  # steps to do before it returns
    EVALUATIONS: int = 7  # of the rate, in all
    COLUMN: int = 8  # of what an observer sees, next
    DUE: int = 9  # period of the next sample, where steps do not end at samples
    MET: int = 10  # the same of the next shared state
    WALKED: int = 11  # row of the ends of steps, next
    EVENT: int = 12  # the switching function that has changed sign


Now = _Entries()


class Functions(NamedTuple):
    """Functions of the state equation, from `evaluate`, called by steps and the time loop.

    Attributes:
        rate: y', of a single run also u.
        tick: The next own numbers.
        energy: K and V.
        sample: What a sample holds.
        jacobian: See `RightSide`.
        events: Values of the events.
        step, behind: See `RightSide`.
        actuation: u, of runs in lock step in which it changes between ticks.
        bodies: Mass matrix and loads, where something may hold joints: as of `bodies`.
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
    """W runs: their states (m, W), own numbers (O, W), and what is known of each (W,); the rest is room to work.

    Attributes:
        y, run_parameters: State, and numbers of each run: first what a sampled controller holds.
        after, made, command, u, energies, size, lost: y⁺, a sample, a tick, the actuation, K and V, Σ |y⁺|, stages
            not found.
        alive, why, ended: 1 while it goes on; then the reason and the time.
        last: Its state where it ended, (m, W).
        energy, scale: E(0), and 1 + |K(0)| + |V(0)|.
        peak: Largest K at the looks at the energy.
        keys: Seed and number of the run, of which its noise is, (2, W), as uint64.
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
        n, works: Number of joints, and of works at the end of y.
        states: Number of states of the controller, behind q and v.
        held: Number of torques in the zero-order hold of a sampled controller; 0 for any other.
        instants, acting: Ticks of the controller in each of its periods, and which of them changes its torque.
        deviates: Number of its last states that are redrawn before each tick.
        canonical: Whether y has momenta in place of velocities.
        alone: Whether what may end a run is looked at by its driver.
        largest: Σ |y| beyond which a step is doubtful, or a run in lock step ends.
        every, thin: Steps between shared states, 0 for none; and how many of these to one that is kept.
        base: First run of the records.
        apart: In lock step, steps between the instants at which u is observed; 0 where it is held between ticks.
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
    """Runs at the states y (m, W) with their own numbers (O, W), of these numbers in a batch (W,)."""
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
    """Nan in x (r, W) for the runs that have ended."""
    if below(runs.why, 1):
        return
    for b in range(len(runs.alive)):
        if runs.alive[b] == 0:
            erase(x, b)


def erase(x: Array, b: int) -> None:
    """Nan in place of the numbers of a run."""
    for e in range(len(x)):
        x[e, b] = np.nan
