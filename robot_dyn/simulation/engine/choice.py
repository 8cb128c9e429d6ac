"""The choice of the engine of a run; the interpreted one is built in, any other is a plug-in.

ENGINES maps each plug-in to its function, "module:function", with the arguments (setup, min_evaluations). The function
is imported on first use, so that a run depends on the protocol `Engine` and not on machine code.
"""

from __future__ import annotations

from pkgutil import resolve_name

from robot_dyn.simulation.dynamics.declarations import named
from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.engine.interpreted import interpreted_engine
from robot_dyn.simulation.setup.setup import Setup

ENGINES = {"compiled": "robot_dyn.simulation.compiled.choice:choose"}


def choose(setup: Setup, min_evaluations: float = 0) -> Engine:
    """Return the engine that runs a setup.

    Args:
        setup: The setup to run.
        min_evaluations: Lower bound of the number of evaluations, without companion runs.

    Raises:
        TraceError: If engine is "compiled" and a part cannot be compiled; names the part.
        MachineError: If the machine code does not agree with the interpreted engine.
    """
    if setup.engine == "interpreted":
        return interpreted_engine(setup)
    if setup.engine == "auto" and (parts := setup.undeclared):  # a trace might miss changes in them
        return interpreted_engine(setup, " ".join((named(parts[0][0]), parts[0][1])))
    return resolve_name(ENGINES["compiled"])(setup, min_evaluations)
