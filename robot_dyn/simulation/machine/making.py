"""The making of machines: motions traced and kept, so that a second run of the same parts compiles nothing.

machine(motion, method) → Machine
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any, final

import numpy as np

from robot_dyn.compiled.cache import default_store
from robot_dyn.compiled.symbolic import TraceError
from robot_dyn.effects.plant import Plant
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.machine.machine import Machine
from robot_dyn.simulation.machine.program import Program
from robot_dyn.simulation.machine.traced import SymbolicDynamics, robot_of, trace, with_values
from robot_dyn.simulation.motion import Motion

# Of a march, which goes through Numba line by line: about a minute of compiling, by estimate.
_MOST_INSTRUCTIONS = 40_000


@final
class Same:
    """A key that stands for one object, and keeps it."""

    def __init__(self, what: Any) -> None:
        self.what = what

    def __hash__(self) -> int:
        return id(self.what)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and self.what is other.what


@lru_cache(maxsize=8)
def _robot(dynamics: Same) -> tuple[Robot, SymbolicDynamics]:
    robot = robot_of(dynamics.what)
    if robot is None:
        raise TraceError(
            f"{type(dynamics.what).__name__} comes from no robot's file and cannot be compiled: take a Robot, "
            "or engine='interpreted'"
        )
    if robot.joint_without_inertia is not None:
        raise TraceError(f"joint {robot.joint_without_inertia!r} carries no inertia: take engine='interpreted'")
    return robot, SymbolicDynamics(robot)


@lru_cache(maxsize=16)
def _program(
    dynamics: Same, effects: tuple[Same, ...], controller: Same, canonical: bool, method: Integrator | None,
    lanes: int, free: tuple[tuple[str, int], ...], tau: bool,
) -> tuple[Motion, Program]:  # fmt: skip
    robot, _ = _robot(dynamics)
    kinds = tuple(each.what for each in effects)
    motion = Motion(Plant(robot, kinds), controller.what, canonical)
    equations = trace(motion, lambda body: _robot(Same(body))[1], dict(free), tile=lanes > 1)
    if not tau:
        equations = replace(equations, actuation=None)
    name = f"{robot.name} by {method.name}" if method is not None else robot.name
    return motion, Program(equations, method, lanes, robot.n, motion.memory_size, name, default_store())


def machine(
    motion: Motion,
    method: Integrator | None,
    *,
    lanes: int = 1,
    free: dict[str, np.ndarray] | None = None,
    tau: bool = False,
) -> Machine:
    """The machine of a motion, from the latest ones if it is among them; not compiled yet.

    Args:
        motion: What to compile.
        method: One whose steps run whole in machine code; None for the rate alone.
        lanes: Runs side by side.
        free: What differs from run to run, by name, with values to check it at.
        tau: Whether runs side by side record their actuation.

    Raises:
        TraceError: If a part of the motion cannot be compiled; names it, with the remedy.
    """
    values = free or {}
    made, program = _program(
        Same(motion.plant.dynamics), tuple(map(Same, motion.plant.effects)), Same(motion.controller), motion.canonical,
        method, lanes, tuple((name, len(x)) for name, x in values.items()), tau,
    )  # fmt: skip
    if program.instructions > _MOST_INSTRUCTIONS:
        raise TraceError(
            f"the run takes {program.instructions} instructions, more than the {_MOST_INSTRUCTIONS} worth compiling;"
            " simulate it with engine='interpreted'"
        )
    return Machine(
        with_values(made, values), program, method is not None, np.concatenate([*values.values(), np.zeros(0)])
    )
