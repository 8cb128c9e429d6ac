"""Events: switching functions of the user, and the events that occurred in a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from inspect import signature
from typing import final

import numpy as np

from robot_dyn.foundations.errors import QueryError, shown
from robot_dyn.foundations.validate import instance, truth

_DIRECTIONS = (-1, 0, 1)


@final
@dataclass(frozen=True, eq=False)
class Event:
    """A user-defined event: g(t, q, v) = 0.

    An integration step ends at the event. Within a step, g is evaluated on the dense output at each eighth, and a
    minimum of |g| near 0 is searched for. This detects two crossings between neighbouring eighths; a second
    minimum between them may be missed.

    Attributes:
        function: g, a function of (t, q, v) that returns a number.
        direction: 1 for crossings with increasing g only, −1 for decreasing g only, 0 for both.
        terminal: True to end the run at the event.
        name: Name for messages; by default the name of the function.

    Raises:
        QueryError: If the function does not take three arguments, or an option is not allowed.
    """

    function: Callable[[float, np.ndarray, np.ndarray], float | np.floating] = field(repr=False)
    direction: int = 0
    terminal: bool = False
    name: str = ""

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise QueryError(f"function: give a function of (t, q, v), got {shown(self.function)}")
        if type(self.direction) is not int or self.direction not in _DIRECTIONS:
            raise QueryError(f"direction must be -1, 0 or 1, got {shown(self.direction)}")
        truth("terminal", self.terminal)
        instance("name", self.name, str, "give a text")
        try:
            signature(self.function).bind(0.0, None, None)
        except TypeError:
            raise QueryError(f"event {self.function!r}: give a function of (t, q, v)") from None
        except ValueError:  # some functions written in C do not expose their arguments
            pass
        if not self.name:
            object.__setattr__(self, "name", getattr(self.function, "__name__", type(self.function).__name__))


@final
@dataclass(frozen=True)
class Occurrence:
    """An event that occurred in a run.

    Attributes:
        t: Time of the event, in [s].
        name: A phrase such as "upper stop of panda_joint2 touched", or the name of the user-defined event.
        direction: 1 if the switching function increases, −1 if it decreases.
        q: Position at the event, n numbers, in [rad] or [m].
        v: Velocity after the event, n numbers, in [rad/s] or [m/s].
        joint: Name of the joint of the event; empty for a user-defined event.
    """

    t: float
    name: str
    direction: int
    q: tuple[float, ...]
    v: tuple[float, ...]
    joint: str = ""
