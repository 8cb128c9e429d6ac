"""The implementations of M, C, N, inverse and forward dynamics whose digits and times are compared."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from types import SimpleNamespace
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


def evaluate(engine: Any, quantity: Quantity, states: dict[str, np.ndarray]) -> np.ndarray:
    """Answers at states (S, n), some at a time, eight of machine code side by side; NaN where there is none."""
    rows = [states[name] for name in quantity.arguments]
    parts = [slice(k, k + 512) for k in range(0, len(rows[0]), 512)]
    answer = getattr(engine, quantity.name)
    return np.concatenate([answer(*(x[part] for x in rows), errors="nan") for part in parts])


def implementations(robot: Robot) -> tuple[list[Implementation], list[str]]:
    """Return the implementations for a robot, and what is left out and why."""
    left_out, quantities = list[str](), tuple(QUANTITIES.values())
    if robot.joint_without_inertia is not None:
        left_out.append(f"forward dynamics: joint {robot.joint_without_inertia!r} carries no inertia")
        quantities = tuple(quantity for quantity in quantities if not quantity.solves)
    options = [Implementation("Pinocchio", robot, robot, quantities)]
    for name in ("float32", "float64", "longdouble"):
        engine = Lagrangian(robot, getattr(np, name))
        options.append(Implementation(f"Lagrangian, {name}", robot, engine, quantities))
    if not robot.couplings.trivial:
        left_out.append("articulated bodies: they take no coupled joints")
    elif FORWARD_DYNAMICS in quantities:
        options.append(Implementation("articulated body", robot, _articulated_body(robot), (FORWARD_DYNAMICS,)))
    try:
        compiled = CompiledDynamics(robot)
        for quantity in quantities:
            quantity.ask(compiled, {name: np.full(robot.n, 0.3) for name in ("q", "v", "a", "tau")})
        served = tuple(quantity for quantity in quantities if compiled.served_by(quantity.name) != "Pinocchio")
        options.append(Implementation("machine code", compiled.robot, compiled, served))
    except (ImportError, RobotDynError) as error:
        left_out.append(f"machine code: {error}")
    return options, left_out


def _articulated_body(robot: Robot) -> SimpleNamespace:
    """Forward dynamics by articulated bodies, with the signature of `Dynamics`."""
    own = Lagrangian(robot)
    equation = partial(articulated_body, own.linkage)

    def forward_dynamics(q: Array, v: Array, tau: Array, *, errors: str = "raise") -> Array:
        return answered(equation, {"q": q, "v": v, "tau": tau}, (own.n,), own.joint_names, errors, FLOAT64)

    return SimpleNamespace(forward_dynamics=forward_dynamics)
