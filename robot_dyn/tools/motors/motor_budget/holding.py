"""The torque with which brakes must hold an arm against gravity: the largest one found over the joint limits.

    max |N_i(q)|   by 1000 random positions and local ascent, next to the bound Σ m g r of `gravity_bound`

A search proves no bound. A brake above the bound holds at every position; one below the largest torque found does not.
Friction, springs and the losses of gears are not counted, and neither are motions that a brake must stop.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from robot_dyn import Robot
from robot_dyn.foundations import largest_found, reported, search_box
from robot_dyn.model import gravity_bound

_POSITIONS = 1000
_ROUNDING = 1e-12  # of the largest entry of N: smaller torques are rounding


@final
@dataclass(frozen=True)
class Holding:
    """The brake of a joint, and the torque of gravity that it holds; for a prismatic joint read [N] for [N m].

    Attributes:
        brake: Torque of the brake at the joint, in [N m].
        gravity: Largest |N_i| found over the joint limits, with payloads, in [N m].
        q: Position of the arm there, in [rad] or [m].
        bound: Upper bound Σ m g r of |N_i|, in [N m].
    """

    brake: float
    gravity: float
    q: tuple[float, ...]
    bound: float

    @reported
    def factor(self) -> float:
        """Torque of the brake over the largest torque of gravity found; inf without gravity."""
        return self.brake / self.gravity if self.gravity else np.inf


def holdings(robot: Robot, brakes: Mapping[str, float], seed: int = 0) -> dict[str, Holding]:
    """Return the torque that each brake holds, by joint; random positions of an arm depend on the seed only."""
    if not brakes:
        return {}
    low, high = search_box(robot.lower, robot.upper, robot.joint_types)
    states = np.random.default_rng(seed).uniform(low, high, (_POSITIONS, robot.n))
    N, bound = robot.N(states), gravity_bound(robot.model, robot.couplings)
    rounding = _ROUNDING * np.abs(N).max()

    def held(i: int) -> tuple[float, tuple[float, ...]]:
        q = largest_found(lambda q: robot.N(q)[:, i], states, N[:, i], low, high)
        found = abs(float(robot.N(q)[i]))
        return found if found > rounding else 0.0, tuple(q.tolist())

    joints = {name: robot.joint_names.index(name) for name in brakes}
    return {name: Holding(brakes[name], *held(i), float(bound[i])) for name, i in joints.items()}
