"""The implementations of M, C, N, inverse and forward dynamics whose digits and times are compared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.accuracy.correct_digits import QUANTITIES
from robot_dyn.codegen.dynamics import CompiledDynamics
from robot_dyn.foundations.arithmetic import FLOAT64, Array
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.recursions.articulated_body import articulated_body
from robot_dyn.model.robot import Robot
from robot_dyn.queries.batch import answered
from robot_dyn.queries.dynamics import FORWARD_DYNAMICS
from robot_dyn.queries.quantity import Quantity

LONGDOUBLE = "Lagrangian, longdouble"


@final
@dataclass(frozen=True, eq=False)
class ArticulatedBody:
    """Forward dynamics by articulated bodies, with the signature of `Dynamics`."""

    own: Lagrangian

    def forward_dynamics(self, q: Array, v: Array, tau: Array, *, errors: str = "raise") -> Array:
        """As of `Dynamics`."""

        def equation(q: Array, v: Array, tau: Array) -> Array:
            return articulated_body(self.own.linkage, q, v, tau)

        state = {"q": q, "v": v, "tau": tau}
        return answered(equation, state, (self.own.n,), self.own.joint_names, errors, FLOAT64)


@final
@dataclass(frozen=True, eq=False)
class Implementation:
    """One implementation of the equations.

    Attributes:
        name: Of program or formulation, and numbers.
        robot: Whose equations it has.
        engine: Answers each quantity by the method of its name.
        quantities: That it answers.
    """

    name: str
    robot: Robot
    engine: Any
    quantities: tuple[Quantity, ...]

    @cached_property
    def fine(self) -> Lagrangian | None:
        """The same equations in numbers that are finer by far; None if only balls are finer."""
        longdouble = np.finfo(np.longdouble).eps < np.finfo(np.float64).eps / 100
        return Lagrangian(self.robot, np.longdouble) if longdouble and self.name != LONGDOUBLE else None

    def evaluate(self, quantity: Quantity, states: dict[str, np.ndarray]) -> np.ndarray:
        """Answers at states (S, n); NaN where there is none."""
        return evaluate(self.engine, quantity, states)

    def call(self, quantity: Quantity, state: dict[str, np.ndarray]) -> Callable[[], object]:
        """A query of one state, ready to be timed."""
        method, arguments = getattr(self.engine, quantity.name), [state[name] for name in quantity.arguments]
        return lambda: method(*arguments)


def evaluate(engine: Any, quantity: Quantity, states: dict[str, np.ndarray]) -> np.ndarray:
    """Answers at states (S, n), some at a time, eight of machine code side by side; NaN where there is none."""
    rows = [states[name] for name in quantity.arguments]
    parts = [slice(k, k + 512) for k in range(0, len(rows[0]), 512)]
    answer = getattr(engine, quantity.name)
    return np.concatenate([answer(*(x[part] for x in rows), errors="nan") for part in parts])


def implementations(robot: Robot) -> tuple[list[Implementation], list[str]]:
    """Return the implementations for a robot, and what is left out and why."""
    every = tuple(QUANTITIES.values())
    left_out: list[str] = []
    if robot.joint_without_inertia is not None:
        left_out.append(f"forward dynamics: joint {robot.joint_without_inertia!r} carries no inertia")
        every = tuple(each for each in every if not each.solves)
    found = [Implementation("Pinocchio", robot, robot, every)]
    for name in ("float32", "float64", "longdouble"):
        found.append(Implementation(f"Lagrangian, {name}", robot, Lagrangian(robot, getattr(np, name)), every))
    if not robot.couplings.trivial:
        left_out.append("articulated bodies: they take no coupled joints")
    elif FORWARD_DYNAMICS in every:
        found.append(Implementation("articulated body", robot, ArticulatedBody(Lagrangian(robot)), (FORWARD_DYNAMICS,)))
    try:
        compiled = CompiledDynamics(robot)
        state = {name: np.full(robot.n, 0.3) for name in ("q", "v", "a", "tau")}
        for each in every:
            each.ask(compiled, state)
        served = tuple(each for each in every if compiled.served_by(each.name) != "Pinocchio")
        found.append(Implementation("machine code", compiled.robot, compiled, served))
    except (ImportError, RobotDynError) as error:
        left_out.append(f"machine code: {error}")
    return found, left_out
