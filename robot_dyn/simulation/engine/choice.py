"""The choice of the engine of a run; the interpreted one is built in, any other is a plug-in.

ENGINES names the function of each plug-in as an entry point does, "module:function". It is called as (setup, seen) and
is imported on use, so that a run knows the protocol `Engine` and no machine code.
"""

from __future__ import annotations

from pkgutil import resolve_name

from robot_dyn.simulation.dynamics.declarations import named
from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.engine.interpreted import interpreted_engine
from robot_dyn.simulation.setup.setup import Setup

ENGINES = {"compiled": "robot_dyn.simulation.compiled.choice:choose"}


def choose(setup: Setup, seen: float = 0) -> Engine:
    """Return the engine that runs a setup.

    Args:
        setup: What to run.
        seen: A lower bound of its evaluations, without its companions.

    Raises:
        TraceError: If engine is "compiled" and a part cannot be; names it.
        MachineError: If the machine code does not agree with the interpreted engine.
    """
    if setup.engine == "interpreted":
        return interpreted_engine(setup)
    if setup.engine == "auto" and (parts := setup.undeclared):  # they may do what a trace would lose
        return interpreted_engine(setup, " ".join((named(parts[0][0]), parts[0][1])))
    return resolve_name(ENGINES["compiled"])(setup, seen)
