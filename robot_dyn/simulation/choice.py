"""The choice of the loop that runs a setup: machine code, or Python where compiling does not pay or cannot be.

evaluations · cost of one, interpreted  >  time to compile
"""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.errors import RobotDynError
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.simulation.motion import Motion
from robot_dyn.simulation.setup import Setup
from robot_dyn.simulation.smoothness import foreign

if TYPE_CHECKING:
    from robot_dyn.simulation.machine.machine import Machine

# Measured on two cores at about 3 GHz: imports and the trace take 1 to 1.5 s, Numba 3 s for 7 joints and RK4, and more
# with more joints. Below the first a machine is not even looked for in the store, below the second none is made.
_TRACE_S = 1.5
_COMPILE_S, _COMPILE_S_PER_JOINT = 1.5, 0.4
_GUESSED = 10  # evaluations in a step of an implicit method, beside those of its Jacobian
_PER_SECOND = 4000  # evaluations of an adaptive method, for each second of the run


def choose(setup: Setup, motion: Motion) -> tuple[Machine | None, str]:
    """The machine that runs a setup, or None for the interpreted engine; and words for the summary.

    Raises:
        TraceError: If engine is "compiled" and a part cannot be; names it.
        MachineError: If the machine code does not agree with the interpreted engine.
    """
    if setup.engine == "interpreted":
        return None, "interpreted"
    if setup.engine == "compiled":
        return _machine(setup, motion), _label(setup)
    if parts := foreign(setup):  # they may have effects of their own, which a trace would lose
        return None, f"interpreted ({type(parts[0]).__name__} is not the library's own)"
    seconds = _evaluations(setup) * _cost(setup, motion)
    if seconds < _TRACE_S:
        return None, "interpreted (short: compiling does not pay)"
    try:
        made = _made(setup, motion)
        if not made.equations.ready and seconds < _COMPILE_S + _COMPILE_S_PER_JOINT * motion.plant.dynamics.n:
            return None, "interpreted (short: compiling does not pay)"
        made.check(setup)
    except (ImportError, RobotDynError) as error:
        return None, f"interpreted ({error})"
    return made, _label(setup)


def _machine(setup: Setup, motion: Motion) -> Machine:
    made = _made(setup, motion)
    made.check(setup)
    return made


def _made(setup: Setup, motion: Motion) -> Machine:
    from robot_dyn.simulation.machine.making import machine

    method: Any = setup.integrator
    return machine(motion, method if method.plain else None)


def _label(setup: Setup) -> str:
    return "compiled" if setup.integrator.plain else "compiled (the equation of motion; steps in Python)"


def _evaluations(setup: Setup) -> float:
    """About how many evaluations of the equation of motion a run takes, with its companions."""
    method: Any = setup.integrator
    if isinstance(method, Adaptive):
        return _PER_SECOND * setup.duration_s * (3 if setup.estimate_error else 1)
    return (
        setup.steps * (2 if setup.estimate_error else 1) * (method.evaluations_per_step or _GUESSED + 2 * len(setup.q0))
    )


def _cost(setup: Setup, motion: Motion) -> float:
    """Time of one evaluation in the interpreted engine, in [s]."""
    y, held = motion.start(setup.q0, setup.v0), np.zeros(len(setup.q0)) if motion.sampled else None
    best = np.inf
    try:
        with np.errstate(all="ignore"):
            for _ in range(3):
                began = perf_counter()
                motion.rate(0.0, y, held)
                best = min(best, perf_counter() - began)
    except RobotDynError:  # the run will tell
        return 0.0
    return best
