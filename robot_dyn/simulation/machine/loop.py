"""The time loop as machine code: one for each step function, whatever it is that moves.

The functions of the state equation are addresses; so a loop is compiled once for a version of this library.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import cache
from inspect import getsource
from typing import Any

from robot_dyn.compiled import elimination as elimination  # a step of a stiff method calls it
from robot_dyn.compiled.cache import default_store
from robot_dyn.compiled.overload import compiled
from robot_dyn.compiled.primitives import machine_code, plain
from robot_dyn.integrate import rosenbrock
from robot_dyn.simulation import time_loop

plain(
    *(
        getattr(time_loop, name)
        for name in ("act", "share", "sample", "take", "conserve", "end", "erase_ended", "erase", "show")
    )
)


plain(rosenbrock.start, rosenbrock.stages)


@cache
def loop(step: Callable[..., int]) -> Callable[..., int]:
    """The loop of a step function, compiled for the arguments of its first call."""
    made: list[Any] = []
    lock = threading.Lock()

    def advance(*arguments: Any) -> int:
        if not made:
            with lock:
                made[:] = made or [_compiled(step, arguments)]
        return made[0](*arguments)

    return advance


def _compiled(step: Callable[..., int], arguments: tuple[Any, ...]) -> Any:
    import numba as nb

    def make() -> Any:
        plain(step)
        return machine_code(time_loop.time_loop(step))

    types = [nb.typeof(each) for each in arguments]
    identity = [f"{step.__module__}.{step.__qualname__}", getsource(step)]  # it may be of a user's own
    return compiled(make, types, default_store(), identity, f"the time loop of {step.__name__}")
