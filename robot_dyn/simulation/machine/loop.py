"""The time loop as machine code: one for each method, whatever it is that moves.

The functions of the state equation are addresses; so a loop is compiled once for a version of this library.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from functools import cache
from inspect import getsource
from time import perf_counter
from typing import Any

from robot_dyn.compiled import elimination as elimination  # a step of a stiff method calls it
from robot_dyn.compiled.cache import default_store
from robot_dyn.compiled.overload import compiled
from robot_dyn.compiled.primitives import machine_code, reached

Loop = Callable[..., int]


class _Spent(threading.local):
    """Of each thread on its own: what another one compiles is no time of this one's run."""

    seconds = 0.0


_spent = _Spent()


def spent_on_loops() -> float:
    """Time that this thread has spent on loading and compiling loops, in [s]; a run's first call does so."""
    return _spent.seconds


@cache
def loop(make: Callable[..., Loop], *functions: Callable[..., Any]) -> Loop:
    """The loop that `make` gives of the plain functions of a method, compiled for the arguments of its first call."""
    made: list[Any] = []
    lock = threading.Lock()

    def advance(*arguments: Any) -> int:
        if not made:
            began = perf_counter()
            with lock:
                made[:] = made or [_compiled(make(*functions), arguments, functions[0])]
            _spent.seconds += perf_counter() - began
        return made[0](*arguments)

    return advance


def _compiled(advance: Loop, arguments: tuple[Any, ...], of: Callable[..., Any]) -> Any:
    import numba as nb

    types, functions = [nb.typeof(each) for each in arguments], reached(advance)
    about = f"the time loop of {of.__module__}.{of.__name__}"
    if not all(map(_imported, functions[1:])):  # a step of a user's own, of types that no other process has
        return compiled(lambda: machine_code(advance), types, None, [], about)
    identity = [f"{each.__module__}.{each.__qualname__} {getsource(each)}" for each in functions]
    return compiled(lambda: machine_code(advance), types, default_store(), identity, about)


def _imported(function: Callable[..., Any]) -> bool:
    """Whether another process finds a function by its name, as not one of a script or of an interactive session."""
    module = function.__module__ or "__main__"
    found = getattr(sys.modules.get(module), function.__qualname__, None)
    return module.startswith("robot_dyn.") or (module != "__main__" and found is function)
