"""What may hold joints as numbers: its laws, the mode of a run, and room; plain functions of these, for the loop.

Coordinates of what holds and strikes are q of the joints, then δ = θ − q of each motor in a rigid backlash:

    M' = [M + E B Eᵀ, E B; B Eᵀ, B],    load' = (load + E u_m, u_m),   u_m = u − b θ̇,   B = n² J

E picks the joints of the motors. The ends of a gap are stops of δ. [As of `effects.rigid_backlash`]
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from robot_dyn.effects.settling import Settling
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.primitives import evaluate
from robot_dyn.simulation.events.event_log import EventLog


class Laws(NamedTuple):
    """The laws of N coordinates, n of them joints, the others gaps; S effects have stops. Ends of gaps are in each.

    Tables have two columns for N = 1, since machine code has a type for arrays of one column; so have those of `Room`.

    Attributes:
        n: Number of joints.
        joints: The joint of each coordinate, (N,).
        rows, speeds, impulses: Entries of y: its position, its velocity, and the impulse of its reaction, (N,).
        motors, works: Those of each gap: θ̇, and the work of its effect, (N − n,).
        inertia: B of each motor, (N − n,).
        least, most: What may act where the velocity is 0, away from stops, (N,).
        sliding: Friction where sliding begins, (N,).
        rubs: Whether it may stick where its velocity is 0, (N,).
        lower, upper, restitution: Stops, ∓inf for none, and e, (S, N).
        lowest, highest: Where a stop is touched, to rounding, (S, N).
        works_of_stops: Entries of y that are the work of each effect with stops; −1 of none, (S,).
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
    rubs: Array
    lower: Array
    upper: Array
    restitution: Array
    lowest: Array
    highest: Array
    works_of_stops: Array


class Room(NamedTuple):
    """Room for an event.

    Attributes:
        out: What `Functions.bodies` gives, (n² + n + N − n, 1).
        y: A state, (m, 1).
        M: Mass matrix of the joints, (n, n).
        whole, load: M' and load', (N, N) and (N,).
        side: Of the stop that is touched, or 0, (N,).
        v, first, after: Velocity at an impact, behind it, and behind the bounces that follow, (N,).
        ended: In how long a joint rests, inf for those that do not, (N,).
        least, most, forced, a: As of `settle`, (N,).
        held, direction: A mode that is not that of the run, (N,).
        was_held, was_direction: The mode before the event, (N,).
        struck: 1 for each joint that has struck a stop in it, (n,).
        settling: Of the convex problems.
    """

    out: Array
    y: Array
    M: Array
    whole: Array
    load: Array
    side: Array
    v: Array
    first: Array
    after: Array
    ended: Array
    least: Array
    most: Array
    forced: Array
    a: Array
    held: Array
    direction: Array
    was_held: Array
    was_direction: Array
    struck: Array
    settling: Settling


class Places(NamedTuple):
    """Where the mode stands among the run parameters: first row of each n of them, (k,)."""

    held: Array
    direction: Array
    contact: Array


class Holding(NamedTuple):
    """The mode of a run.

    Attributes:
        laws: Of what may hold joints.
        places: Where the mode stands among the run parameters.
        held, direction: As of `Mode`, of all coordinates, (N,).
        contact: As of `Mode`, (n,).
        run_parameters: Run parameters of the equation in which nothing is held and parts switch by themselves, (O, 1).
        held_actuation: How many of them are the actuation in zero-order hold, the first ones.
        impacts, strikes, latest: Times of the latest impacts, which coordinates struck, (I,) and (I, N); their number.
        changes, changed: Times of the latest changes of the mode, (C,), and the number of all changes, (1,).
        brief: The time in which C changes are too many.
        log: What happened.
        room: Room to work.
    """

    laws: Laws
    places: Places
    held: Array
    direction: Array
    contact: Array
    run_parameters: Array
    held_actuation: int
    impacts: Array
    strikes: Array
    latest: Array
    changes: Array
    changed: Array
    brief: float
    log: EventLog
    room: Room


def touched(laws: Laws, s: int, y: Array, i: int) -> float:
    """−1 for a coordinate at a lower stop, or beyond it, 1 at an upper one, else 0."""
    x = y[laws.rows[i], 0]
    return -1.0 if x <= laws.lowest[s, i] else 1.0 if x >= laws.highest[s, i] else 0.0


def snap(laws: Laws, y: Array, first: int, end: int) -> None:
    """Let coordinates that touch a stop lie exactly there, in y."""
    for s in range(len(laws.lower)):
        for i in range(first, end):
            side = touched(laws, s, y, i)
            if side != 0.0:
                y[laws.rows[i], 0] = laws.lower[s, i] if side < 0.0 else laws.upper[s, i]


def intervals(laws: Laws, y: Array, least: Array, most: Array) -> None:
    """Write what may act on coordinates whose velocity is 0."""
    for i in range(len(laws.rows)):
        least[i], most[i] = laws.least[i], laws.most[i]
        for s in range(len(laws.lower)):
            side = touched(laws, s, y, i)
            if side > 0.0:
                least[i] = -np.inf
            elif side < 0.0:
                most[i] = np.inf


def bodies(f: Any, t: float, y: Array, p: Array, of: Holding) -> None:
    """Write M, M' and load' of a state."""
    laws, room, n = of.laws, of.room, of.laws.n
    for first in of.places.direction:
        for i in range(n):
            of.run_parameters[first + i, 0] = np.sign(y[n + i, 0])
    evaluate(f.bodies, t, y, p, of.run_parameters, room.out)
    for i in range(n):
        for j in range(n):
            room.M[i, j] = room.whole[i, j] = room.out[i * n + j, 0]
        room.load[i] = room.out[n * n + i, 0]
    for k in range(len(laws.motors)):
        i, gap, B, torque = laws.joints[n + k], n + k, laws.inertia[k], room.out[n * n + n + k, 0]
        for j in range(n + len(laws.motors)):
            room.whole[gap, j] = room.whole[j, gap] = 0.0
        room.whole[i, gap] = room.whole[gap, i] = room.whole[gap, gap] = B
        room.whole[i, i] += B
        room.load[i] += torque
        room.load[gap] = torque


def take(laws: Laws, y: Array, v: Array) -> float:
    """Take the velocities behind an impact, with the works of gaps, in y; the sum of these."""
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


def part(laws: Laws, y: Array) -> None:
    """Let motors keep their speeds where the velocities of their joints have jumped, in y."""
    for k in range(len(laws.motors)):
        i = laws.n + k
        y[laws.speeds[i], 0] = y[laws.motors[k], 0] - y[laws.speeds[laws.joints[i]], 0]


def move_motors(of: Holding, y: Array) -> None:
    """Let motors that rest at an end of their gap move with their joints, in y; and keep at which."""
    laws = of.laws
    for k in range(len(laws.motors)):
        i, joint = laws.n + k, laws.joints[laws.n + k]
        rests = of.held[i] > 0.0
        of.contact[joint] = touched(laws, 0, y, i) if rests else 0.0
        if rests:
            y[laws.motors[k], 0] = y[laws.speeds[joint], 0]


def write_mode(of: Holding, run_parameters: Array) -> None:
    """Write the mode where the run parameters have it."""
    for i in range(of.laws.n):
        for first in of.places.held:
            run_parameters[first + i, 0] = of.held[i]
        for first in of.places.direction:
            run_parameters[first + i, 0] = of.direction[i]
        for first in of.places.contact:
            run_parameters[first + i, 0] = of.contact[i]
