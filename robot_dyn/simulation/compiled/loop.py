"""The time loop as machine code: one for each method, whatever it is that moves.

The functions of the state equation are addresses; so a loop is compiled once for a version of this library.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from robot_dyn.arithmetic import FLOAT64
from robot_dyn.codegen.llvm.machine_code import Passes
from robot_dyn.codegen.loops.call import QUICK, MachineFunction
from robot_dyn.codegen.loops.source import SubsetError
from robot_dyn.codegen.primitives import INSTEAD
from robot_dyn.codegen.store.cache import default_store
from robot_dyn.integrate.integrator import PlainMethod
from robot_dyn.simulation.dynamics.loop_state import Functions
from robot_dyn.simulation.dynamics.state_equation import StateEquation

HARD = Passes(level=3, effort=3)


@cache
def loop(
    make: Callable[..., Callable[..., int]], *functions: Callable[..., Any], works: bool = False
) -> MachineFunction:
    """The loop that `make` gives of the plain functions of a method, and whether it works beside what it calls."""
    about = f"the time loop of {functions[0].__module__}.{functions[0].__name__}"
    return MachineFunction(make(*functions), INSTEAD, default_store, about, HARD if works else QUICK)


def refusal(method: PlainMethod, equation: StateEquation, lanes: int) -> SubsetError | None:
    """Why the step of a method written elsewhere cannot be machine code; None if it can, as those of this library."""
    n, m = equation.plant.dynamics.n, equation.size
    made = method.stepper(FLOAT64, m, n, m + n, lanes)
    if (made.step.__module__ or "").startswith("robot_dyn."):
        return None
    y, run_parameters, lost = np.zeros((m, lanes)), np.zeros((1, lanes)), np.zeros(lanes, np.int64)
    step = MachineFunction(made.step, INSTEAD, lambda: None, "")
    functions = Functions(*[0] * len(Functions._fields))
    try:
        step.check(
            functions,
            made.coefficients,
            0.0,
            1.0,
            y,
            np.zeros(2),
            run_parameters,
            np.zeros((m, lanes)),
            made.work,
            lost,
        )
    except SubsetError as error:
        return error
    return None
