"""Data of a time loop: functions of the state equation, lanes, settings, and the position of the loop."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from math import inf
from typing import NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.values import aligned
from robot_dyn.integrate.primitives import below
from robot_dyn.simulation.dynamics.state_equation import StateEquation

_FIRST = np.zeros(1, np.int64)
Function = Callable[..., object] | int  # in machine code its address; 0 for none
"""A function of (t, y, p, run_parameters, out): a Python function, the address of machine code, or 0 for none."""


class Ended(IntEnum):
    """The reason for which a time loop returned."""

    DONE = 0
    PAUSED = 1  # the budget of steps is used up, a stop is requested, or the log of events is full
    NEEDS_REVIEW = 2  # the next step is doubtful, and Python repeats it; y is the state before it
    TICK = 3  # the torque of the controller is not finite
    ENERGY_GROWS = 4  # energy may grow without a source; y is the state after the step
    TOO_SMALL = 5  # no step large enough to change t in floating point is within the tolerance
    NOT_FINITE = 6  # the rate at y is not finite
    FAST = 7  # a joint moves without bound; y is the state after the step
    EVENT = 8  # an event; y is the state at the event
    PAYLOAD = 9  # a payload is picked up or dropped; y is the state before it
    CHANGED = 10  # the mode, and with it the side of a threshold, has changed; y is the state after it
    ACCUMULATED = 11  # mode changes accumulate in a very short time
    UNSETTLED = 12  # no state and mode after an event satisfy the laws


class LaneEnd(IntEnum):
    """The reason for which a run in lock step ended."""

    RUNNING = 0
    OVERFLOW = 1
    ENERGY_GAIN = 2
    NO_STAGES = 3  # the stages of a step were not found


class Phase(IntEnum):
    """The phase of the event loop within a segment."""

    TICK = 0  # at the start of the segment, before the tick of the controller
    RESTART = 1  # after the tick, or after an event: the method starts again
    STEPS = 2


class Position(NamedTuple):
    """The position of a time loop, each an array of length 1; rows and columns are the next ones to write.

    Attributes:
        segment: Index of the segment.
        step: Number of steps done in the segment, of a loop of fixed steps.
        phase: See `Phase`; of a loop with events.
        steps, evaluations: Number of steps and of evaluations of the rate so far.
        budget: Number of steps before the loop returns.
        sample_row, shared_row, step_row: Rows of samples, of shared states and of ends of steps.
        column: Column of the observer's data.
        shareable: Number of states that might be shared, of a loop of fixed steps.
        sample, share: Number of the next period of samples, and of shared states, of a loop with events.
        event: Index of the switching function that changed sign last.
        time: Time reached, in [s], of a loop with events.
        sample_time: Time of the next sample, in [s], of a loop of fixed steps; inf for none.
    """

    segment: Array
    step: Array
    phase: Array
    steps: Array
    evaluations: Array
    budget: Array
    sample_row: Array
    shared_row: Array
    step_row: Array
    column: Array
    shareable: Array
    sample: Array
    share: Array
    event: Array
    time: Array
    sample_time: Array


def start_position(sample_time: float = 0.0) -> Position:
    """Return the position at the start of a run, with the time of its first sample; the last two fields are floats."""
    position = Position._make([*np.zeros((len(Position._fields) - 2, 1), np.int64), *np.zeros((2, 1))])
    position.sample_time[0] = sample_time
    return position


class Functions(NamedTuple):
    """Functions of the state equation for `evaluate`, called by steps and time loops; 0 for those that are not needed.

    Attributes:
        rate: y'; for a single run also u.
        tick: Actuation of the controller until the next tick, and its next states.
        energy: K and V, in [J].
        sample: Numbers of a sample.
        jacobian: See `RightSide`.
        events: Torques that reach limited parts, then values of user-defined events; see `event_values`.
        step, after_step: See `RightSide`.
        actuation: u, for runs in lock step where u changes between ticks.
        bodies: Mass matrix and loads, if joints may be held; see `bodies`.
    """

    rate: Function
    tick: Function
    energy: Function
    sample: Function
    jacobian: Function = 0
    events: Function = 0
    step: Function = 0
    after_step: Function = 0
    actuation: Function = 0
    bodies: Function = 0


class Lanes(NamedTuple):
    """W runs in lock step, or one; a step takes them as its `States`.

    Attributes:
        y, after: State, and state at the end of a step, (m, W).
        p: Numbers of the segment, (P,).
        run_parameters: Parameters of each run, (O, W); the torques that a sampled controller holds come first.
        failed: 1 where the stages of a step were not found, (W,).
        inner: State within a step, (m, W).
        sampled, command, u, energies, size: Workspace for a sample, a tick, the actuation, K and V, and Σ |y⁺|.
        reason: Reason for which the run ended, 0 while it continues, see `LaneEnd`, (W,).
        end_time, end_state: Time, in [s], and state at its end, (W,) and (m, W).
        energy, scale: E(0), and 1 + |K(0)| + |V(0)|, (W,).
        peak: Largest K at the energy checks, (W,).
        keys: Seed, number and first tick of each run, which determine its noise, (3, W), as uint64.
    """

    y: Array
    after: Array
    p: Array
    run_parameters: Array
    failed: Array
    inner: Array
    sampled: Array
    command: Array
    u: Array
    energies: Array
    size: Array
    reason: Array
    end_time: Array
    end_state: Array
    energy: Array
    scale: Array
    peak: Array
    keys: Array


class LoopConfig(NamedTuple):
    """Settings of a time loop.

    Attributes:
        n, works: Number of joints, and number of works at the end of y.
        states: Number of controller states, which follow q and v.
        held: Number of torques in zero-order hold: n with a sampled controller, else 0.
        instants, acting: Ticks per controller period, and the index of the one at which the torque changes.
        deviates: Number of trailing controller states that are redrawn before each tick.
        canonical: True if y has momenta instead of velocities.
        alone: True if Python checks what may end a run; False for runs in lock step.
        largest: Σ |y| beyond which a step is doubtful, or a run in lock step ends.
        every, thin: Steps between states that may be shared, 0 for none; and how many of these to one that is stored.
        base: Column of the first run in the records.
        apart: Steps between observations of u in lock step; 0 if u is constant between ticks.
        sample_period, sample_slack: Time between samples, and the time by which a sample may be early, in [s].
        share_period: Time between shared states, of a loop with events, in [s]; inf for none.
        samples_nodes, samples_steps: True for a sample at the start of each segment, and at the end of each step.
        duration: End of the run, in [s].
        restarts: True if the method chooses its step again after an event.
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
    largest: float = inf
    every: int = 0
    thin: int = 1
    base: int = 0
    apart: int = 0
    sample_period: float = 0.0
    sample_slack: float = 0.0
    share_period: float = inf
    samples_nodes: bool = False
    samples_steps: bool = False
    duration: float = 0.0
    restarts: bool = False


def loop_config(equation: StateEquation, alone: bool) -> LoopConfig:
    """Return the settings of a loop over a state equation; the fields of `LoopConfig` with a default have it."""
    n, controller = equation.plant.dynamics.n, equation.controller
    return LoopConfig(
        n=n,
        works=len(equation.sources),
        states=equation.state_size,
        held=n if equation.sampled else 0,
        instants=1 if controller is None else len(controller.instants),
        acting=0 if controller is None else controller.acting_instant,
        deviates=0 if controller is None else controller.deviates,
        canonical=equation.canonical,
        alone=alone,
    )


def lanes_of(
    equation: StateEquation,
    y: np.ndarray,
    run_parameters: np.ndarray,
    sampled: int,
    p: np.ndarray,
    numbers: np.ndarray = _FIRST,
) -> Lanes:
    """Return the lanes of runs at their start.

    Args:
        equation: The state equation.
        y: States, (m, W).
        run_parameters: Parameters, (O, W).
        sampled: Entries of a sample.
        p: Numbers of the first segment, (P,).
        numbers: Positions of the runs in a batch, (W,).
    """
    (m, W), n = y.shape, equation.plant.dynamics.n
    seed, run = (0, 0) if equation.controller is None else equation.controller.noise_key
    start, after = aligned((2, m, W))
    start[...] = y
    keys = np.zeros((3, W), np.uint64)
    keys[0], keys[1] = seed, numbers
    keys[1] += np.uint64(run)
    rows = {"inner": m, "end_state": m, "sampled": sampled, "u": n, "energies": 2}
    rows["command"] = n * equation.sampled + equation.state_size
    scalars = "size", "end_time", "energy", "peak"
    return Lanes(
        y=start,
        after=after,
        p=p.copy(),
        run_parameters=np.array(run_parameters, order="C"),
        failed=np.zeros(W, np.int64),
        reason=np.zeros(W, np.int64),
        scale=np.ones(W),
        keys=keys,
        **{name: np.zeros((count, W)) for name, count in rows.items()},
        **dict(zip(scalars, np.zeros((len(scalars), W)), strict=True)),
    )


def erase_ended(x: Array, lanes: Lanes) -> None:
    """Write nan into x (r, W) for the runs that have ended."""
    if below(lanes.reason, 1):
        return
    for b in range(len(lanes.reason)):
        if lanes.reason[b] != 0:
            for e in range(len(x)):
                x[e, b] = np.nan
