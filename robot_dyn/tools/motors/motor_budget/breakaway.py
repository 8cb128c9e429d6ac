"""The torque at which joints with static friction leave rest, or go on where they reverse.

    τ_b = τ − τ_sliding + f_s sign(v⁺)

τ is that of the motion just after, τ_sliding the part that overcomes dry friction, f_s the static friction, and v⁺ the
velocity after. A motor that does not reach τ_b does not start the joint.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_dyn import Plant
from robot_dyn.effects import Causes, SetValued, numbered, torques_by_cause
from robot_dyn.tools.motors.motor_budget.cells import Cells

_RESTS = 1e-9  # of the largest velocity of a joint


class Breakaway(NamedTuple):
    """Torques τ_b, (b,), of joints by number, at times in [s]; empty without static friction."""

    joint: np.ndarray
    t: np.ndarray
    torque: np.ndarray


def static_friction(plant: Plant) -> np.ndarray:
    """f_s of each joint, of all dry friction, (n,), in [N m] or [N]."""
    n = plant.dynamics.n
    most = [each.at_rest(np.zeros(n)).most for each in plant.forces if isinstance(each, SetValued) and each.rubs]
    return np.sum(most, axis=0) if most else np.zeros(n)


def breakaway(cells: Cells, plant: Plant) -> Breakaway:
    """Where joints with static friction leave rest or reverse."""
    friction = static_friction(plant)
    if not friction.any():
        return Breakaway(np.zeros(0, int), np.zeros(0), np.zeros(0))
    every = np.arange(len(cells.piece))
    middle, start = (cells.states(every, np.full(len(every), x))[2] for x in (0.0, -1.0))
    largest = cells.largest_speed
    starts = (np.abs(start) <= _RESTS * largest) & (np.abs(middle) > _RESTS * largest) & (friction > 0)
    cell, joint = np.nonzero(starts)
    split = torques_by_cause(plant, *cells.states(cell, np.full(len(cell), -1.0)))
    row = np.arange(len(cell))
    without = split.tau[row, joint] - _sliding(split, plant)[row, joint]
    return Breakaway(joint, split.t, without + friction[joint] * np.sign(middle[cell, joint]))


def _sliding(split: Causes, plant: Plant) -> np.ndarray:
    """The part of the torque that overcomes dry friction, (k, n)."""
    names = numbered(*(each.name for each in plant.forces))
    rub = [
        split.torques[name]
        for name, each in zip(names, plant.forces, strict=True)
        if isinstance(each, SetValued) and each.rubs
    ]
    return np.sum(rub, axis=0)
