"""The time loop as machine code: one for each method, whatever it is that moves.

The functions of the state equation are addresses; so a loop is compiled once for a version of this library.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from robot_dyn.compiled.cache import default_store
from robot_dyn.compiled.leaf_loops import INSTEAD
from robot_dyn.compiled.loops.call import MachineFunction


@cache
def loop(make: Callable[..., Callable[..., int]], *functions: Callable[..., int]) -> MachineFunction:
    """The loop that `make` gives of the plain functions of a method."""
    of = functions[0]
    return MachineFunction(make(*functions), INSTEAD, default_store, f"the time loop of {of.__module__}.{of.__name__}")
