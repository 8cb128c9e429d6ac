"""The time loops as machine code: one for each method, for all plants.

The functions of the state equation are addresses, so that a loop is compiled once for a version of this library.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from robot_dyn.codegen.llvm.machine_code import Passes
from robot_dyn.codegen.loops.call import QUICK, MachineFunction
from robot_dyn.codegen.loops.source import SubsetError
from robot_dyn.codegen.primitives import INSTEAD
from robot_dyn.codegen.store.cache import default_store
from robot_dyn.foundations.arithmetic import FLOAT64
from robot_dyn.integrate import hermite
from robot_dyn.integrate.adaptive import STEPPERS, Adaptive
from robot_dyn.integrate.integrator import PlainMethod, States
from robot_dyn.simulation.dynamics.loop_state import Functions
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.events.detection import detecting
from robot_dyn.simulation.events.mode_change import end_mode, without_modes
from robot_dyn.simulation.run.event_loop import event_loop
from robot_dyn.simulation.run.time_loop import time_loop

HARD = Passes(level=3, effort=3)


def loop_for(
    method: PlainMethod | Adaptive, equation: StateEquation, cuts: bool, lanes: int, detects: bool = False
) -> MachineFunction | SubsetError:
    """Return the loop of a method, or the reason why its user-defined step cannot be machine code.

    Raises:
        SubsetError: That reason, for runs in lock step, which require machine code.
    """
    if isinstance(method, PlainMethod) and (refused := _refusal(method, equation, lanes)) is not None:
        if lanes > 1:
            raise refused
        return refused
    return loop_of(method, cuts, detects, bool(equation.impulses))


def loop_of(method: PlainMethod | Adaptive, cuts: bool, detects: bool = False, holds: bool = False) -> MachineFunction:
    """Return the time loop of a method with plain steps. It loads in milliseconds if `is_kept`, else in about a second.

    Args:
        method: A method of fixed step, or an adaptive one.
        cuts: True if the method chooses its steps, or if steps end at events.
        detects: See `machine_code`.
        holds: True if an effect may hold joints.
    """
    if isinstance(method, PlainMethod) and not cuts:
        step = method.stepper(FLOAT64, 1, 0, 1).step
        return _translated(time_loop, detecting(step) if detects else step, is_long=method.nonsmooth)
    stepper = (
        STEPPERS[method.method](1, 1, 1) if isinstance(method, Adaptive) else hermite.stepper(method, 1, 0, 1, None)
    )
    change_mode = end_mode if holds else without_modes
    return _translated(
        event_loop, stepper.begin, stepper.step, stepper.error, stepper.accept, stepper.dense, change_mode
    )


@cache
def _translated(
    make_loop: Callable[..., Callable[..., int]], *functions: Callable[..., object], is_long: bool = False
) -> MachineFunction:
    """Return the loop that `make_loop` returns for the functions of a method; `is_long` if a step computes much."""
    about = f"the time loop of {functions[0].__module__}.{functions[0].__name__}"
    return MachineFunction(make_loop(*functions), INSTEAD, default_store, about, HARD if is_long else QUICK)


def _refusal(method: PlainMethod, equation: StateEquation, lanes: int) -> SubsetError | None:
    """Return the reason why the step of a user-defined method cannot be machine code; None if it can."""
    n, m = equation.plant.dynamics.n, equation.size
    stepper = method.stepper(FLOAT64, m, n, m + n, lanes)
    if (stepper.step.__module__ or "").startswith("robot_dyn."):
        return None
    x = States(
        y=np.zeros((m, lanes)),
        after=np.zeros((m, lanes)),
        p=np.zeros(2),
        run_parameters=np.zeros((1, lanes)),
        failed=np.zeros(lanes, np.int64),
    )
    step = MachineFunction(stepper.step, INSTEAD, lambda: None, "")
    functions = Functions(*[0] * len(Functions._fields))
    try:
        step.check(functions, stepper.coefficients, stepper.work, 0.0, 1.0, x)
    except SubsetError as error:
        return error
    return None
