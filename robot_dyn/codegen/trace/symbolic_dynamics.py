"""A symbolic `Dynamics`; each quantity uses the formulation with the fewest instructions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from inspect import getdoc
from typing import Any, final

import casadi as ca
import numpy as np

from robot_dyn.codegen.parameters import Parameter, described, split
from robot_dyn.codegen.trace.symbolic import Symbols, array_of, column, inputs
from robot_dyn.codegen.trace.trace import Trace, Traced
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.tree import Described
from robot_dyn.queries.dynamics import Dynamics


def _least(name: str) -> Any:
    """Method for a quantity, from the formulation with the fewest instructions."""

    def ask(self: SymbolicDynamics, *arguments: Array) -> Any:
        return self._ask(name, arguments)

    ask.__doc__ = getattr(Dynamics, name).__doc__
    return ask


def _closed_form(name: str) -> Any:
    """Property for an attribute of the closed form."""
    return property(lambda self: getattr(self._trace.lagrangian, name), doc=getdoc(getattr(Lagrangian, name)))


def _kinematic(name: str) -> Any:
    """Method for a quantity of the closed form that needs no inertia."""

    def ask(self: SymbolicDynamics, *arguments: Any, **options: Any) -> Any:
        return getattr(self._trace.lagrangian, name)(*arguments, **options).view(Symbols)

    ask.__doc__ = getattr(Dynamics, name).__doc__
    return ask


@final
class SymbolicDynamics:
    """Symbolic dynamics of a robot.

    Args:
        robot: File and edits of the robot.
        known: Numbers of the robot that are inputs (gravity and payloads); all others are constants.
    """

    M, C, N = map(_least, ("M", "C", "N"))
    coriolis_torque, coriolis_transpose = map(_least, ("coriolis_torque", "coriolis_transpose"))
    inverse_dynamics, forward_dynamics, momentum = map(_least, ("inverse_dynamics", "forward_dynamics", "momentum"))
    kinetic_energy, potential_energy = map(_least, ("kinetic_energy", "potential_energy"))
    total_energy = Dynamics.total_energy
    n, joint_names, arithmetic = map(_closed_form, ("n", "joint_names", "arithmetic"))
    placement, jacobian, jacobian_rate = map(_kinematic, ("placement", "jacobian", "jacobian_rate"))

    def __init__(self, robot: Described, known: Sequence[Parameter] = ()) -> None:
        vector, symbols = inputs("numbers", sum(each.size for each in known))
        values = {key: x for own in split(known, symbols).values() for key, x in own.items()}
        self._trace = Trace(described(robot, values) if known else robot, (vector,) if known else ())
        self._traced: dict[str, Traced] = {}
        self._given: tuple[Any, ...] = self._trace.given
        self._known = known

    def of(self, values: Mapping[str, Any]) -> SymbolicDynamics:
        """Return a copy whose inputs take these values, in the order of `known`."""
        if not values:
            return self
        other = copy(self)
        inputs = (np.ravel(values[each.key])[list(each.entries)] for each in self._known)
        other._given = (ca.vertcat(*map(column, inputs)),)
        return other

    def formulation(self, quantity: str) -> str:
        """Formulation used for a quantity, the one with the fewest instructions."""
        return self._quantity(quantity).formulation

    def _quantity(self, name: str) -> Traced:
        if name not in self._traced:
            self._traced[name] = self._trace.quantity(name)
        return self._traced[name]

    def _ask(self, name: str, arguments: tuple[Array, ...]) -> Any:
        value = array_of(self._quantity(name).function(*map(column, arguments), *self._given))
        shape = self._trace.shape(name)
        return value[0, 0] if shape == (1,) else value.reshape(shape).view(Symbols)
