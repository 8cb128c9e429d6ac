"""Every query of a robot and its arguments, with general states to ask at."""

from __future__ import annotations

from typing import Any

import numpy as np

import robot_dyn as rd
from robot_dyn.queries import QUANTITIES

ARGUMENTS = {quantity.name: quantity.arguments for quantity in QUANTITIES.values()}
FRAMED = tuple(name for name, quantity in QUANTITIES.items() if quantity.framed)
SEVERAL = [method for method, names in ARGUMENTS.items() if len(names) > 1]


def general(robot: rd.Robot, seed: int) -> np.ndarray:
    """General q, v and a (or tau): no zeros, no symmetries."""
    return np.random.default_rng(seed).uniform(0.1, 1.2, (3, robot.n)) * [[1], [-1], [1]]


def arguments_of(method: str, n: int, seed: int = 0, batch: tuple[int, ...] = ()) -> list[np.ndarray]:
    """General arguments of a method."""
    return list(np.random.default_rng(seed).uniform(0.1, 1.2, (len(ARGUMENTS[method]), *batch, n)))


def ask(robot: rd.Robot, method: str, *arguments: Any) -> Any:
    frame = [robot.frame_names[-1]] if method in FRAMED else []
    return getattr(robot, method)(*arguments, *frame)


def assert_close(actual: Any, expected: Any, case: str = "") -> None:
    """Equal but for the order of sums in products of matrices, 1e-13 of the largest entry."""
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-13 * np.max(np.abs(expected), initial=0), err_msg=case)
