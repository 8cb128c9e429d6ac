"""The contact mode of a run as arrays: its laws and work arrays; plain functions of these, for the loop.

Coordinates that may be held or strike are q of the joints, then δ = θ − q of each motor in a rigid backlash:

    M' = [M + E B Eᵀ, E B; B Eᵀ, B],    load' = (load + E u_m, u_m),   u_m = u − b θ̇,   B = n² J

E selects the joints of the motors. The ends of a gap are stops of δ. See `effects.rigid_backlash`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_dyn.effects.settling import Settling
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.primitives import evaluate
from robot_dyn.simulation.dynamics.loop_state import Functions
from robot_dyn.simulation.events.event_log import EventLog


class ContactLaws(NamedTuple):
    """The laws of N coordinates, n joints and then the gaps; S effects have stops, each with the ends of gaps.

    Tables have at least two columns, also for N = 1, because machine code has a type for arrays of one column.

    Attributes:
        n: Number of joints.
        joints: The joint of each coordinate, (N,).
        rows, speeds, impulses: Entries of y: its position, its velocity, and the impulse of its reaction, (N,).
        motors, works: Entries of y for each gap: θ̇, and the work of its effect, (N − n,).
        inertia: B of each motor, (N − n,).
        least, most: Bounds of the friction at rest, away from stops, (N,).
        sliding: Friction where sliding begins, (N,).
        has_friction: True if the coordinate may stick where its velocity is 0, (N,).
        lower, upper, restitution: Stops, ∓inf for none, and e, (S, N).
        lowest, highest: Positions at which a stop is touched, to rounding, (S, N).
        works_of_stops: Entry of y that is the work of each effect with stops; −1 for none, (S,).
    """

    n: int
    joints: Array
    rows: Array
    speeds: Array
    impulses: Array
    motors: Array
    works: Array
    inertia: Array
    least: Array
    most: Array
    sliding: Array
    has_friction: Array
    lower: Array
    upper: Array
    restitution: Array
    lowest: Array
    highest: Array
    works_of_stops: Array


class EventWorkspace(NamedTuple):
    """Work arrays for event handling.

    Attributes:
        out: Output of `Functions.bodies`, (n² + n + N − n, 1).
        y: A state, (m, 1).
        M: Mass matrix of the joints, (n, n).
        M_all, load: M' and load', (N, N) and (N,).
        side: Side of the stop that is touched, or 0, (N,).
        v, v_impact, v_rest: Velocity before an impact, after it, and after the bounces that follow, (N,).
        rest_time: Time until a joint rests, in [s], inf if it does not, (N,).
        held, direction: Mode after the impact, which `settle` writes, (N,).
        previous_held, previous_direction: Mode before the event, (N,).
        struck: 1 for each joint that struck a stop in the event, (n,).
        settling: Arrays of the convex problems.
    """

    out: Array
    y: Array
    M: Array
    M_all: Array
    load: Array
    side: Array
    v: Array
    v_impact: Array
    v_rest: Array
    rest_time: Array
    held: Array
    direction: Array
    previous_held: Array
    previous_direction: Array
    struck: Array
    settling: Settling


class Places(NamedTuple):
    """The places of the mode among the run parameters: first row of each n of them, (k,)."""

    held: Array
    direction: Array
    contact: Array


class ContactMode(NamedTuple):
    """The contact mode of a run.

    Attributes:
        laws: Laws of the coordinates.
        places: Places of the mode among the run parameters.
        held, direction: See `Mode`, of all coordinates, (N,).
        contact: See `Mode`, (n,).
        run_parameters: Parameters of the equation in which no joint is held and parts switch within steps, (O, 1).
        held_actuation: Number of leading run parameters that are the actuation in zero-order hold.
        impacts, strikes: Times of the latest impacts, and 1 for each coordinate that struck in them, (I,) and (I, N).
        impact_count: Number of these impacts, (1,).
        changes, change_count: Times of the latest changes of the mode, (C,), and the number of all changes, (1,).
        brief: Time within which C changes accumulate, in [s].
        log: Log of events.
        work: Work arrays.
    """

    laws: ContactLaws
    places: Places
    held: Array
    direction: Array
    contact: Array
    run_parameters: Array
    held_actuation: int
    impacts: Array
    strikes: Array
    impact_count: Array
    changes: Array
    change_count: Array
    brief: float
    log: EventLog
    work: EventWorkspace


def touched(laws: ContactLaws, s: int, y: Array, i: int) -> float:
    """Return −1 for a coordinate at a lower stop or beyond it, 1 at an upper one, else 0."""
    x = y[laws.rows[i], 0]
    return -1.0 if x <= laws.lowest[s, i] else 1.0 if x >= laws.highest[s, i] else 0.0


def snap(laws: ContactLaws, y: Array, first: int, end: int) -> None:
    """Move coordinates that touch a stop exactly onto it, in y."""
    for s in range(len(laws.lower)):
        for i in range(first, end):
            side = touched(laws, s, y, i)
            if side != 0.0:
                y[laws.rows[i], 0] = laws.lower[s, i] if side < 0.0 else laws.upper[s, i]


def write_reaction_bounds(mode: ContactMode, y: Array) -> None:
    """Write the bounds of the reactions at rest, least and most, into the work arrays.

    They are those of friction; a touched stop may push without limit, away from itself.
    """
    laws, least, most = mode.laws, mode.work.settling.least, mode.work.settling.most
    for i in range(len(laws.rows)):
        least[i], most[i] = laws.least[i], laws.most[i]
        for s in range(len(laws.lower)):
            side = touched(laws, s, y, i)
            if side > 0.0:
                least[i] = -np.inf
            elif side < 0.0:
                most[i] = np.inf


def write_bodies(f: Functions, t: float, y: Array, p: Array, mode: ContactMode) -> None:
    """Write M, M' and load' of a state into the work arrays."""
    laws, work, n = mode.laws, mode.work, mode.laws.n
    for first in mode.places.direction:
        for i in range(n):
            mode.run_parameters[first + i, 0] = np.sign(y[n + i, 0])
    evaluate(f.bodies, t, y, p, mode.run_parameters, work.out)
    for i in range(n):
        for j in range(n):
            work.M[i, j] = work.M_all[i, j] = work.out[i * n + j, 0]
        work.load[i] = work.out[n * n + i, 0]
    for k in range(len(laws.motors)):
        i, gap, B, torque = laws.joints[n + k], n + k, laws.inertia[k], work.out[n * n + n + k, 0]
        for j in range(n + len(laws.motors)):
            work.M_all[gap, j] = work.M_all[j, gap] = 0.0
        work.M_all[i, gap] = work.M_all[gap, i] = work.M_all[gap, gap] = B
        work.M_all[i, i] += B
        work.load[i] += torque
        work.load[gap] = torque


def apply_velocities(laws: ContactLaws, y: Array, v: Array) -> float:
    """Write the velocities after an impact into y, and add −B (θ̇⁺ − θ̇)(v⁺ + v)/2, the work of each gap on its joint.

    Return the sum of these works, which the work of the stops leaves out.
    """
    total, n = 0.0, laws.n
    for k in range(len(laws.motors)):
        joint, motor = laws.joints[n + k], laws.motors[k]
        after = v[joint] + v[n + k]
        work = -laws.inertia[k] * (after - y[motor, 0]) * (v[joint] + y[laws.speeds[joint], 0]) / 2
        y[motor, 0] = after
        y[laws.works[k], 0] += work
        total += work
    for i in range(len(v)):
        y[laws.speeds[i], 0] = v[i]
    return total


def keep_motor_speeds(laws: ContactLaws, y: Array) -> None:
    """Keep the speeds of motors where the velocities of their joints have jumped: write δ̇ into y."""
    for k in range(len(laws.motors)):
        i = laws.n + k
        y[laws.speeds[i], 0] = y[laws.motors[k], 0] - y[laws.speeds[laws.joints[i]], 0]


def move_motors(mode: ContactMode, y: Array) -> None:
    """Move motors that rest at an end of their gap with their joints, in y; write the end into the mode."""
    laws = mode.laws
    for k in range(len(laws.motors)):
        i, joint = laws.n + k, laws.joints[laws.n + k]
        rests = mode.held[i] > 0.0
        mode.contact[joint] = touched(laws, 0, y, i) if rests else 0.0
        if rests:
            y[laws.motors[k], 0] = y[laws.speeds[joint], 0]


def write_mode(mode: ContactMode, run_parameters: Array) -> None:
    """Write the mode into the run parameters."""
    for i in range(mode.laws.n):
        for first in mode.places.held:
            run_parameters[first + i, 0] = mode.held[i]
        for first in mode.places.direction:
            run_parameters[first + i, 0] = mode.direction[i]
        for first in mode.places.contact:
            run_parameters[first + i, 0] = mode.contact[i]
