"""Quantities of an arm or a plant as CasADi Functions, for optimisation and estimation."""

from __future__ import annotations

import casadi as ca
import numpy as np

import robot_dyn as rd
from robot_dyn.foundations import truth
from robot_dyn.tools.export.equations import chosen, equations_of, result_name
from robot_dyn.tools.export.exported import values_of


def casadi(arm_or_plant: rd.Robot | rd.Plant, quantity: str, *, open_parameters: bool = False) -> ca.Function:
    """Return a quantity as a `casadi.Function` of SX: smooth, branch-free, with derivatives of any order.

    Its inputs are q, v, a or the torque, each (n,), as in the method of that name; then t if an effect depends on the
    time, and p if the parameters are open. M and C are (n, n), the others (n,).
    Right angles that the file states with few digits are exact, as in `rd.compiled`.

    Args:
        arm_or_plant: A robot, or a plant with effects that neither switch nor have states.
        quantity: "M", "C", "N", "inverse_dynamics" or "forward_dynamics".
        open_parameters: True for an input p, see `parameter_values`; otherwise they have their values.

    Raises:
        ExportError: If an effect switches, holds joints or has states.
        QueryError: If an argument is not allowed.
    """
    truth("open_parameters", open_parameters)
    equations = equations_of(arm_or_plant)
    (name,) = chosen(equations, [quantity])
    traced = equations.function(name, is_open=open_parameters)
    arguments = dict(zip(traced.name_in(), traced.sx_in(), strict=True))
    result = traced(*arguments.values())
    n = equations.robot.n
    result = ca.reshape(result, n, n).T if name in ("M", "C") else result  # CasADi counts by columns
    if open_parameters:
        arguments.setdefault("p", ca.SX.sym("p", len(equations.p)))
    ordered = sorted(arguments, key=lambda x: ("t", "p").index(x) if x in ("t", "p") else -1)
    return ca.Function(name, [arguments[x] for x in ordered], [result], ordered, [result_name(name)])


def parameter_values(plant: rd.Plant) -> dict[str, np.ndarray]:
    """Return the values of the parameters p of an exported plant by name, in their order; concatenated they are p.

    Raises:
        ExportError: If an effect switches, holds joints or has states.
        QueryError: If it is neither a robot nor a plant.
    """
    return {parameter.name: values_of(parameter) for parameter in equations_of(plant).parameters}
