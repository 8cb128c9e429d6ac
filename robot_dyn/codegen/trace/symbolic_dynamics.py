"""A symbolic `Dynamics`; each quantity uses the formulation with the fewest instructions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any, final

import casadi as ca
import numpy as np

from robot_dyn.codegen.parameters import Parameter, described, split
from robot_dyn.codegen.trace.symbolic import Symbolic, Symbols, array_of, column, inputs
from robot_dyn.codegen.trace.trace import Trace, Traced
from robot_dyn.foundations.arithmetic import Scalar
from robot_dyn.lagrange.tree import Described
from robot_dyn.queries.dynamics import Dynamics


@final
class SymbolicDynamics(Dynamics[Symbols]):
    """Symbolic dynamics of a robot.

    Args:
        robot: File and edits of the robot.
        parameters: Values of the robot that are inputs (gravity and payloads); all others are constants.
    """

    def __init__(self, robot: Described, parameters: Sequence[Parameter] = ()) -> None:
        vector, symbols = inputs("numbers", sum(parameter.size for parameter in parameters))
        values = {key: x for own in split(parameters, symbols).values() for key, x in own.items()}
        self._trace = Trace(described(robot, values) if parameters else robot, (vector,) if parameters else ())
        self._traced: dict[str, Traced] = {}
        self._given: tuple[Any, ...] = self._trace.given
        self._parameters = parameters

    @property
    def n(self) -> int:
        return self._trace.lagrangian.n

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self._trace.lagrangian.joint_names

    @property
    def arithmetic(self) -> Symbolic:
        """Arithmetic of all numbers."""
        return self._trace.arithmetic

    def with_parameters(self, values: Mapping[str, Scalar]) -> SymbolicDynamics:
        """Return a copy whose inputs have these values."""
        if not values:
            return self
        other = copy(self)
        inputs = (np.ravel(values[x.key])[list(x.entries)] for x in self._parameters)
        other._given = (ca.vertcat(*map(column, inputs)),)
        return other

    def formulation(self, quantity: str) -> str:
        """Return the formulation used for a quantity, the one with the fewest instructions."""
        return self._quantity(quantity).formulation

    def _quantity(self, name: str) -> Traced:
        if name not in self._traced:
            self._traced[name] = self._trace.quantity(name)
        return self._traced[name]

    def _answer(
        self, name: str, state: tuple[Any, ...], out: Any, frame: tuple[str, ...] = (), *, nan: bool = False
    ) -> Any:
        if frame:  # queries of frames do not need inertias
            return self._trace.lagrangian._answer(name, state, out, frame, nan=nan).view(Symbols)
        value = array_of(self._quantity(name).function(*map(column, state), *self._given))
        shape = self._trace.shape(name)
        return value[0, 0] if shape == (1,) else value.reshape(shape).view(Symbols)
