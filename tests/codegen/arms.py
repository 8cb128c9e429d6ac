"""Arms whose kernels are compiled once in a session, and general states to ask them at."""

from __future__ import annotations

from functools import cache

import numpy as np

import robot_dyn as rd
from robot_dyn.codegen import CompiledDynamics

ARMS = ("ur5", "panda", "mimic_chain", "skew_tree", "planar_2r")


@cache
def compiled(name: str, dtype: str = "float64") -> CompiledDynamics:
    """An arm as machine code, without the cache on disk."""
    robot = rd.load(name)
    if name == "panda":
        robot = robot.with_(lock={"panda_finger_joint1": 0.0})
    return CompiledDynamics(robot, dtype, cache=False)


def states(n: int, count: int = 40, seed: int = 0) -> np.ndarray:
    """q, v and a (or tau) without zeros, (3, count, n)."""
    return np.random.default_rng(seed).uniform(0.1, 2.0, (3, count, n)) * [[[1]], [[-1]], [[1]]]
