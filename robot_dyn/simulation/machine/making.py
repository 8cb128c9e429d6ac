"""The making of machines: state equations traced and compiled, once for all runs of the same parts.

machine(equation, method) → Machine
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from threading import RLock
from typing import Any, final

import numpy as np

from robot_dyn.arithmetic import FLOAT64
from robot_dyn.compiled.from_casadi import program_of
from robot_dyn.compiled.interrupts import interrupts_later
from robot_dyn.compiled.symbolic import TraceError
from robot_dyn.effects.plant import Plant
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.machine.machine import Equations, Machine
from robot_dyn.simulation.machine.payloads import Carrying
from robot_dyn.simulation.machine.traced import SymbolicDynamics, robot_of, trace, with_values
from robot_dyn.simulation.state_equation import StateEquation

_MOST_INSTRUCTIONS = 100_000  # some ten seconds of compiling
_MOST = 64  # values that are kept


@final
class ByIdentity:
    """Values kept by the identity of objects, for as long as all of these live; the latest ones."""

    def __init__(self) -> None:
        self._kept: dict[tuple[Any, ...], tuple[list[weakref.ref[Any]], Any]] = {}
        self._lock = RLock()  # runs may start in several threads

    def get(self, objects: tuple[Any, ...], more: tuple[Any, ...], make: Callable[[], Any]) -> Any:
        """The value of objects and of further, hashable values; it must not hold on to the objects."""
        key = (*map(id, objects), *more)
        with self._lock:
            references, value = self._kept.pop(key, ([], None))
            if not references or any(ref() is not each for ref, each in zip(references, objects, strict=True)):
                references, value = [weakref.ref(each) for each in objects], make()
            self._kept[key] = references, value
            while len(self._kept) > _MOST or any(ref() is None for ref in next(iter(self._kept.values()))[0]):
                del self._kept[next(iter(self._kept))]
            return value


_robots, _symbols, _equations = ByIdentity(), ByIdentity(), ByIdentity()


def _robot(dynamics: Any) -> Robot:
    """The robot whose equations are compiled, its right angles written out in full."""

    def make() -> Robot | None:
        robot = robot_of(dynamics)
        if robot is None:
            raise TraceError(
                f"{type(dynamics).__name__} comes from no robot's file and cannot be compiled: take a Robot, "
                "or engine='interpreted'"
            )
        if robot.joint_without_inertia is not None:
            raise TraceError(f"joint {robot.joint_without_inertia!r} carries no inertia: take engine='interpreted'")
        return None if robot is dynamics else robot

    return _robots.get((dynamics,), (), make) or dynamics


def _symbolic(dynamics: Any) -> SymbolicDynamics:
    """Its equations in symbols; of what describes it, so that it is not held on to."""
    robot = _robot(dynamics)
    described = Carrying(robot.description, robot.edits, robot.joint_names)
    return _symbols.get((dynamics,), (), lambda: SymbolicDynamics(described))


def machine(
    equation: StateEquation,
    method: Integrator | None,
    *,
    lanes: int = 1,
    sweep: dict[str, np.ndarray] | None = None,
    kept: tuple[str, ...] | None = None,
) -> Machine:
    """The machine of a state equation, from the latest ones if it is among them; not compiled yet.

    Args:
        equation: What to compile.
        method: One whose steps are machine code too; None for the state equation alone.
        lanes: Runs in lock step.
        sweep: The sweep parameters by name, with values to check them at.
        kept: As of `trace`.

    Raises:
        TraceError: If a part of the equation cannot be compiled; names it, with the remedy.
    """
    values, plant, controller = sweep or {}, equation.plant, equation.controller
    robot = _robot(plant.dynamics)
    own = (
        equation
        if robot is plant.dynamics
        else StateEquation(Plant(robot, plant.effects), controller, equation.canonical)
    )
    lengths = tuple((name, len(x)) for name, x in values.items())

    @interrupts_later()
    def make() -> Equations:
        functions = trace(own, _symbolic, dict(lengths), kept)
        return Equations({name: program_of(each) for name, each in functions.items()}, lanes, robot.name)

    parts = (plant.dynamics, *plant.effects, *([] if controller is None else [controller]))
    equations = _equations.get(parts, (equation.canonical, lanes, lengths, kept), make)
    if equations.instructions > _MOST_INSTRUCTIONS:
        raise TraceError(
            f"the run takes {equations.instructions} instructions, more than the {_MOST_INSTRUCTIONS} worth compiling;"
            " simulate it with engine='interpreted'"
        )
    numbers = np.concatenate([*values.values(), np.zeros(0)])
    return Machine(
        with_values(own, values) if values else own, equations, numbers, None if method is None else _loop(method)
    )


def _loop(method: Integrator) -> Callable[..., int]:
    from robot_dyn.simulation.machine.loop import loop

    return loop(method.stepper(FLOAT64, 1, 0, 1).step)
