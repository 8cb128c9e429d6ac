"""The torque at which joints with static friction leave rest, or continue after a reversal.

    τ_b = τ − τ_sliding + f_s sign(v⁺)

τ is the torque of the motion just after, τ_sliding its part against dry friction, f_s the static friction, and v⁺ the
velocity just after. A motor that does not reach τ_b does not start the joint. The loss of a gear is added.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_dyn import Plant
from robot_dyn.effects import SetValued, numbered, torques_by_cause
from robot_dyn.tools.motors.gear import Gear
from robot_dyn.tools.motors.motor_budget.cells import Cells

_RESTS = 1e-9  # relative to the largest velocity of a joint: slower is rest


class Breakaway(NamedTuple):
    """Torques τ_b with the index of the joint, the time in [s], the sign of v⁺ and the acceleration, all (b,)."""

    joint: np.ndarray
    t: np.ndarray
    torque: np.ndarray
    direction: np.ndarray
    a: np.ndarray


NO_BREAKAWAY = Breakaway(np.zeros(0, int), *np.zeros((4, 0)))


def static_friction(plant: Plant) -> np.ndarray:
    """Return the static friction f_s of each joint, (n,), in [N m] or [N]."""
    n = plant.dynamics.n
    most = [
        force.at_rest(np.zeros(n)).most for force in plant.forces if isinstance(force, SetValued) and force.has_friction
    ]
    return np.sum(most, axis=0) if most else np.zeros(n)


def breakaway(cells: Cells, plant: Plant, gear: Gear | None = None) -> Breakaway:
    """Return the torques at which joints with static friction leave rest or reverse."""
    friction = static_friction(plant)
    if not friction.any():
        return NO_BREAKAWAY
    every = np.arange(len(cells.piece))
    middle, start = (cells.states(every, np.full(len(every), x))[2] for x in (0.0, -1.0))
    largest = cells.largest_speed
    starts = (np.abs(start) <= _RESTS * largest) & (np.abs(middle) > _RESTS * largest) & (friction > 0)
    cell, joint = np.nonzero(starts)
    states = cells.states(cell, np.full(len(cell), -1.0))
    split = torques_by_cause(plant, *states)
    forces = zip(numbered(*(force.name for force in plant.forces)), plant.forces, strict=True)
    dry = [split.torques[name] for name, force in forces if isinstance(force, SetValued) and force.has_friction]
    row = np.arange(len(cell))
    tau, direction = split.tau - np.sum(dry, axis=0), np.sign(middle[cell])
    tau += friction * direction
    tau += 0.0 if gear is None else gear.loss(tau, direction, states[3])
    return Breakaway(joint, split.t, *(x[row, joint] for x in (tau, direction, states[3])))
